"""The entry point of ``gasp``: runs the command, and turns whatever goes wrong into one line and an exit status."""

from __future__ import annotations

import contextlib
import faulthandler
import io
import os
import sys
import warnings
from collections.abc import Sequence

from gasp_core.errors import GaspError
from gasp_core.processes.termination import terminable

__all__ = ["FAILED", "INTERRUPTED", "TERMINATED", "TRACEBACK_VARIABLE", "main"]

FAILED = 2
"""Exit status of every error."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it (128 + SIGINT)."""
TERMINATED = 143
"""Exit status after SIGTERM, which ends a command as Ctrl-C does (128 + SIGTERM)."""
_BROKEN_PIPE = 141
"""Exit status where nobody reads the output any more (128 + SIGPIPE)."""

COMPLETION_VARIABLE = "_GASP_COMPLETE"
"""What a shell sets when it wants to know how a command goes on."""
TRACEBACK_VARIABLE = "GASP_TRACEBACK"
"""Set in the environment, it makes errors print their traceback before the one line."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``gasp`` with these arguments (those of the process by default) and return its exit status.

    Every error is one line on stderr that begins ``gasp: ``, and status 2.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if not sys.warnoptions:
        # Libraries warn about what is theirs; what matters to the user is an error or in the report.
        warnings.simplefilter("ignore")
    if isinstance(sys.stdout, io.TextIOWrapper):
        # File names need not be text; one that is not must not stop the command that prints it.
        sys.stdout.reconfigure(errors="backslashreplace")
    if not faulthandler.is_enabled():
        # An engine in native code that breaks down takes this process along: where, is all that is ever said of it.
        # Where stderr is no file, nobody would read it.
        with contextlib.suppress(AttributeError, OSError, RuntimeError, ValueError):
            faulthandler.enable(all_threads=False)
    with terminable() as terminated:
        try:
            status = _run(arguments)
            # Here, not at exit: a full disk behind stdout is an error like any other.
            sys.stdout.flush()
            return status
        except KeyboardInterrupt as error:
            _traceback()
            return _complain(str(error) or "interrupted", TERMINATED if terminated.is_set() else INTERRUPTED)
        except BrokenPipeError:
            _abandon_stdout()
            return _BROKEN_PIPE
        except Exception as error:
            _traceback()
            return _complain(_message(error), FAILED)


def _run(arguments: Sequence[str]) -> int:
    import click

    from gasp_core.cli.command_group import gasp

    if wish := os.environ.get(COMPLETION_VARIABLE):
        from click.shell_completion import shell_complete

        return shell_complete(gasp, {}, "gasp", COMPLETION_VARIABLE, wish)
    try:
        # Not click's own main: it ends the process on a broken pipe and forgets what an interrupt had to say.
        with gasp.make_context("gasp", list(arguments) or ["--help"]) as context:
            gasp.invoke(context)
    except click.exceptions.Exit as stop:
        return stop.exit_code
    except click.Abort:
        raise KeyboardInterrupt from None
    return 0


def _message(error: Exception) -> str:
    import click

    if isinstance(error, GaspError):
        return str(error)
    if isinstance(error, click.UsageError):
        command = error.ctx.command_path if error.ctx is not None else "gasp"
        return f'{error.format_message().rstrip(".")}; see "{command} --help"'
    if isinstance(error, click.ClickException):
        return error.format_message()
    if isinstance(error, MemoryError):
        return "out of memory: close other programs, or ask for a lower resolution or fewer Gaussians"
    if isinstance(error, OSError) and error.strerror is not None:
        where = f"{error.filename}: " if error.filename is not None else ""
        return f"{where}{error.strerror}: check that the place exists, may be written to and has room"
    return (
        f"internal error: {type(error).__name__}: {error}"
        f" (a fault of GASP or a plugin; set {TRACEBACK_VARIABLE}=1 for the traceback and report it)"
    )


def _complain(message: str, status: int) -> int:
    from gasp_core.io.format_errors import shown

    line = shown(" ".join(message.split()))
    with contextlib.suppress(OSError):
        print(f"gasp: {line}", file=sys.stderr, flush=True)
    # What stdout still holds must not fail a second time when the interpreter ends.
    try:
        sys.stdout.flush()
    except OSError:
        _abandon_stdout()
    return status


def _traceback() -> None:
    if os.environ.get(TRACEBACK_VARIABLE):
        import traceback

        traceback.print_exc()


def _abandon_stdout() -> None:
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
