"""SIGTERM, which ends a command as Ctrl-C does."""

import signal
import subprocess
import sys
import threading

import pytest

from gasp_core.processes.termination import ignore_termination, terminable


def test_it_interrupts_and_is_told_from_ctrl_c():
    with pytest.raises(KeyboardInterrupt), terminable() as terminated:
        signal.raise_signal(signal.SIGTERM)
    assert terminated.is_set()
    with pytest.raises(KeyboardInterrupt), terminable() as terminated:
        signal.raise_signal(signal.SIGINT)
    assert not terminated.is_set()


def test_whoever_ends_in_order_at_ctrl_c_is_asked():
    asked = []
    was = signal.signal(signal.SIGINT, lambda number, frame: asked.append(number))
    try:
        with terminable() as terminated:
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGINT, was)
    assert asked == [signal.SIGINT] and terminated.is_set()


def test_it_interrupts_where_ctrl_c_is_ignored():
    """In the background of a script."""
    was = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with pytest.raises(KeyboardInterrupt), terminable():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGINT, was)


def test_afterwards_it_is_what_it_was():
    before = signal.getsignal(signal.SIGTERM)
    with terminable():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


def test_other_threads_have_no_signals():
    found = []

    def work():
        with terminable() as terminated:
            found.append(terminated.is_set())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [False]


# What is asked is what a signal from another process does: on Windows that is no signal, it ends a process at once.
@pytest.mark.skipif(
    sys.platform == "win32", reason="Windows sends no SIGTERM: os.kill ends a process, whatever it does"
)
def test_what_ignores_it_does_not_bequeath_that():
    before = signal.getsignal(signal.SIGTERM)
    try:
        ignore_termination()
        signal.raise_signal(signal.SIGTERM)
        killed = subprocess.run([sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"])
    finally:
        signal.signal(signal.SIGTERM, before)
    assert killed.returncode == -signal.SIGTERM
