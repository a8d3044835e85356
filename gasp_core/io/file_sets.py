"""Sets of files, as the frames of a motion, that come to their place together or not at all."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterable
from pathlib import Path

from gasp_core.errors import GaspError
from gasp_core.processes.scratch import Scratch

__all__ = ["coming_together", "is_in_the_making"]

_MAKING = ".gasp-making-"


def is_in_the_making(entry: Path) -> bool:
    """Whether it is where a set is made, or one was whose process has been killed."""
    return entry.name.startswith(_MAKING)


@contextlib.contextmanager
def coming_together(
    folder: Path, earlier: Iterable[Path] = (), *, refused: type[GaspError] = GaspError
) -> Generator[Path]:
    """A place to make files in that are in `folder`, which is made, once the block ends well.

    They are made within the folder, or the one that it will be in: another may be on another disk. It is not exchanged
    for a new one: it may be the current folder, a disk of its own, or what a link points to.

    Parameters
    ----------
    folder
        Where to.
    earlier
        Files there that go when the new ones come, whatever their names: the end of a longer motion would be taken for
        the end of this one.
    refused
        What is raised.

    Raises
    ------
    GaspError
        Where the system refuses; what was in the folder is there as it was.
    """
    with contextlib.ExitStack() as stack:
        try:
            target = folder.resolve()
            scratch = Scratch(_MAKING, next(path for path in (target, *target.parents) if path.exists()))
            stack.callback(scratch.remove)
            made = scratch.path / "made"
            made.mkdir()
        except OSError as error:
            raise _refusal(refused, folder, error) from error
        yield made
        try:
            _exchange(made, target, earlier, scratch.path / "earlier")
        except OSError as error:
            raise _refusal(refused, folder, error) from error


def _exchange(made: Path, target: Path, earlier: Iterable[Path], aside: Path) -> None:
    """Put what was made in the place of what was there; where that fails, all is as it was."""
    aside.mkdir()
    with contextlib.ExitStack() as undoing:
        if not target.exists():
            target.mkdir(parents=True)
            undoing.callback(target.rmdir)
        names = [path.name for path in sorted(made.iterdir())]
        going = {path.name for path in earlier} | {name for name in names if (target / name).is_file()}
        moves = [(target / name, aside / name) for name in sorted(going)]
        moves += [(made / name, target / name) for name in names]
        for here, there in moves:
            here.replace(there)
            undoing.callback(there.replace, here)
        undoing.pop_all()


def _refusal(refused: type[GaspError], folder: Path, error: OSError) -> GaspError:
    return refused(f"{folder}: no files can be made there ({error.strerror}): choose another place")
