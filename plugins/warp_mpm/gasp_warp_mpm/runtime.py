"""Warp, started quietly: standard output belongs to whoever runs us."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from typing import Any

import warp

from gasp_core.contract import device_class, device_index
from gasp_core.errors import EngineEnvironmentError, SceneError

__all__ = ["capture", "device_for", "load", "yield_address"]

_lock = threading.RLock()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence what Warp says of itself, for us alone: others in this process may want to read it."""
    with _lock:
        before = warp.config.log_level
        warp.config.log_level = max(before, warp.LOG_WARNING)
        try:
            yield
        finally:
            warp.config.log_level = before


@contextlib.contextmanager
def _without_talk_of_drivers(talk: bytes) -> Iterator[None]:
    """Withhold a line with such words that Warp's library writes to the process's standard error.

    No setting of Warp's silences it. Whatever else is written meanwhile is handed on.
    """
    sys.stderr.flush()
    with tempfile.TemporaryFile() as held:
        before = os.dup(2)
        os.dup2(held.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            held.seek(0)
            for line in held:
                if talk not in line:
                    os.write(2, line)


def device_for(device: str) -> Any:
    """Warp's device of this name, Warp being started where it is not yet.

    Raises
    ------
    SceneError
        For a device that is neither "cpu" nor "cuda", or of an index that no CPU has.
    EngineEnvironmentError
        Where there is no CUDA GPU, or none of that index.
    """
    kind, index = device_class(device), device_index(device)
    if kind not in ("cpu", "cuda") or (kind == "cpu" and index not in (None, 0)):
        raise SceneError(f'engine warp-mpm has no device {device!r}: use "cpu" or "cuda"')
    with _quiet():
        # Where nobody asked for a GPU, its driver is nothing to talk of; where one did, we say that there is none.
        with _without_talk_of_drivers(b"CUDA driver" if kind == "cpu" else b"Could not find or load the NVIDIA CUDA"):
            warp.init()
        if kind == "cpu":
            return warp.get_device("cpu")
        if not warp.is_cuda_available():
            raise EngineEnvironmentError(
                f'engine warp-mpm: device "{device}" was asked for, but Warp finds no CUDA GPU here: use device "cpu",'
                " or install a CUDA driver"
            )
        count = int(warp.get_cuda_device_count())
        if index is not None and index >= count:
            raise EngineEnvironmentError(
                f'engine warp-mpm: device "{device}" was asked for, but the last CUDA GPU here is cuda:{count - 1}'
            )
        return warp.get_device(device)


def load(module: Any, device: Any) -> None:
    """Compile a module of kernels for a device, or take it from Warp's cache on disk."""
    with _quiet(), _without_precompiled_headers() if device.is_cpu else contextlib.nullcontext():
        warp.load_module(module, device=device)


@contextlib.contextmanager
def _without_precompiled_headers() -> Iterator[None]:
    """Have Warp compile its headers with the kernels, not ahead of them into a folder that a killed process leaves.

    They pay only from the second module on, and a run has one.
    """
    with _lock:
        before = warp.config.use_precompiled_headers
        warp.config.use_precompiled_headers = False
        try:
            yield
        finally:
            warp.config.use_precompiled_headers = before


@contextlib.contextmanager
def capture(device: Any) -> Iterator[Any]:
    """Record launches, which then are not carried out, as a graph to replay.

    One at a time: on the CPU Warp has one recording for the whole process.
    """
    with _lock, warp.ScopedCapture(device, force_module_load=False) as recording:
        yield recording


def yield_address() -> int:
    """Address of the C function without arguments that gives a processor to whoever waits for it; 0 for none."""
    library, name = (
        (ctypes.windll.kernel32, "SwitchToThread") if os.name == "nt" else (ctypes.CDLL(None), "sched_yield")
    )
    function = getattr(library, name, None)
    return 0 if function is None else int(ctypes.cast(function, ctypes.c_void_p).value or 0)
