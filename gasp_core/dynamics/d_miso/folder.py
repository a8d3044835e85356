"""The folder that training leaves: which files of it are played, and what it was trained with."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import SplatFormatError
from gasp_core.io.format_errors import malformed, quoted, shown

__all__ = ["CheckpointFiles", "find_checkpoint", "read_arguments"]

_ARGUMENTS = "cfg_args"
_LONGEST_ARGUMENTS = 1 << 20
"""Bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointFiles:
    """The files of one iteration.

    Parameters
    ----------
    arguments
        What it was trained with; None where the file is gone.
    model
        Cores, and what is attached to them.
    deformation
        Weights of the network that moves the cores.
    turns
        Weights of the one that turns what is attached.
    """

    arguments: Path | None
    model: Path
    deformation: Path
    turns: Path

    def all(self) -> list[Path]:
        """Every file that is read."""
        own = [self.model, self.deformation, self.turns]
        return own if self.arguments is None else [self.arguments, *own]


def find_checkpoint(folder: Path, iteration: str | None) -> CheckpointFiles:
    """The files of an iteration in the folder of a trained D-MiSo.

    Parameters
    ----------
    folder
        With point_cloud, deform and time_net in it.
    iteration
        "best" or a number; None: the best where it was kept, else the last.

    Raises
    ------
    SplatFormatError
        Where the folder is none, or a file of the iteration is missing.
    """
    kept = folder / "point_cloud"
    try:
        if not kept.is_dir():
            raise malformed(
                folder,
                "is no checkpoint of D-MiSo: it has no folder point_cloud",
                "name the folder that training wrote, in which cfg_args lies",
            )
        names = [entry.name.removeprefix("iteration_") for entry in kept.iterdir() if entry.name.startswith("iter")]
    except OSError as error:
        raise malformed(
            folder, f"cannot be read: {error.strerror or error}", "check the path and its permissions"
        ) from error
    numbers = sorted((name for name in names if name.isdecimal()), key=int)
    there = [*numbers, *(["best"] if "best" in names else [])]
    if not there:
        raise malformed(kept, "holds no iteration", "check that training has saved one")
    chosen = there[-1] if iteration is None else iteration
    if chosen not in there:
        raise malformed(kept, f"has no iteration {quoted(chosen)}", f"there are {shown(', '.join(there))[:200]}")
    found = CheckpointFiles(
        arguments=folder / _ARGUMENTS if (folder / _ARGUMENTS).exists() else None,
        model=kept / f"iteration_{chosen}" / "model_params.pt",
        deformation=folder / "deform" / f"iteration_{chosen}" / "deform.pth",
        turns=folder / "time_net" / f"iteration_{chosen}" / "deform.pth",
    )
    for file in found.all():
        if not file.is_file():
            raise malformed(file, "is not there", "all files of an iteration are needed, fetch the folder again")
    return found


def read_arguments(path: Path) -> dict[str, Any]:
    """What was trained with: the plain values of a `Namespace(...)`, which is read and never evaluated.

    Raises
    ------
    SplatFormatError
        Where it is anything else.
    """
    said = "is not what training wrote: Namespace(...) with plain values"
    try:
        if path.stat().st_size > _LONGEST_ARGUMENTS:
            raise malformed(path, said)
        call = ast.parse(path.read_text("utf-8").strip(), mode="eval").body
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Namespace"):
            raise malformed(path, said)
        if call.args or any(keyword.arg is None for keyword in call.keywords):
            raise malformed(path, said)
        return {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    except SplatFormatError:
        raise
    except OSError as error:
        raise malformed(
            path, f"cannot be read: {error.strerror or error}", "check the path and its permissions"
        ) from error
    # A call among the values, no Python, no UTF-8, or nested deeper than Python goes.
    except (ValueError, SyntaxError, RecursionError, MemoryError, TypeError) as error:
        raise malformed(path, said, "nothing of it was run; fetch the folder again") from error
