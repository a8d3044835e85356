"""Where pictures go, by the name of the file."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.rendering.contact_sheet import Sheet, key_frames
from gasp_core.rendering.pictures import PictureFile, PictureFolder
from gasp_core.rendering.video import FILMS, FilmFile

if TYPE_CHECKING:
    from typing import Self

__all__ = ["Output", "open_output"]

Array = NDArray[Any]


class Output(Protocol):
    """Takes the pictures (H, W, 3 | 4) uint8 of a film in their order, all of one size; a context manager.

    What it makes is there under its name once the context ends well, and not at all if an exception ends it.
    """

    def __enter__(self) -> Self:
        """Make ready."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish, or take everything back."""
        ...

    def wants(self, index: int) -> bool:
        """Whether it has a use for the picture of this number."""
        ...

    def take(self, picture: Array, time: float) -> None:
        """The next picture that it wants, at a simulated time [s]."""
        ...


def open_output(path: Path, *, count: int, frame_rate: float, title: str) -> Output:
    """What a name asks for: .mp4, .webm, .gif a film, .png a sheet of key frames, else a folder of pictures.

    Parameters
    ----------
    path
        What is there already is replaced once the new one is whole.
    count
        Number of pictures; one alone is a .png without a sheet around it.
    frame_rate
        Of a film [1/s].
    title
        Of a sheet.

    Raises
    ------
    RenderingError
        Where its ending is of something else, or its folder is not there.
    """
    if not path.absolute().parent.is_dir():
        raise RenderingError(f"{path}: there is no folder {path.parent}: make it, or choose another place")
    suffix = path.suffix.lower()
    if suffix in (*FILMS, ".png") and path.is_dir():
        raise RenderingError(f"{path}: is a folder: name a file")
    if suffix in FILMS:
        return FilmFile(path, frame_rate)
    if suffix == ".png":
        return PictureFile(path) if count == 1 else Sheet(path, title, key_frames(count))
    if suffix and not path.is_dir():
        raise RenderingError(
            f"{path}: can be a film ({', '.join(FILMS)}), a sheet of key frames (.png) or a folder of pictures"
            " (frames/)"
        )
    return PictureFolder(path)
