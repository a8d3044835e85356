"""Pictures as .png files: one, or a folder of them."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.io.atomic import replacing
from gasp_core.io.file_sets import coming_together, is_in_the_making

if TYPE_CHECKING:
    from typing import Self

__all__ = ["PictureFile", "PictureFolder", "write_png"]

Array = NDArray[Any]


_COMPRESSION = 4
"""Of zlib: a tenth larger than its default 6, in half the time."""


def write_png(path: Path, picture: Array) -> None:
    """Write a picture (H, W, 3 | 4) uint8."""
    from PIL import Image

    with replacing(path) as stream:
        Image.fromarray(picture).save(stream, format="PNG", compress_level=_COMPRESSION)


class PictureFile:
    """One picture.

    Parameters
    ----------
    path
        A .png file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._picture: Array | None = None

    def __enter__(self) -> Self:
        """Nothing is written before the end."""
        return self

    def wants(self, index: int) -> bool:
        """Every one."""
        return True

    def take(self, picture: Array, time: float) -> None:
        """The picture; where more come, the last one stays."""
        self._picture = picture

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write it."""
        if error is None:
            if self._picture is None:
                raise RenderingError(f"{self.path}: there is no picture to write")
            write_png(self.path, self._picture)


class PictureFolder:
    """A folder of pictures frame_0000.png, ...; a folder that is there must be empty, or hold an older film.

    Parameters
    ----------
    path
        Of the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._making = path
        self._together = ExitStack()
        self._count = 0

    def __enter__(self) -> Self:
        """Make a place for them beside what is there."""
        there = list(self.path.iterdir()) if self.path.is_dir() else []
        earlier = [entry for entry in there if _is_picture(entry)]
        if any(not is_in_the_making(entry) for entry in there if entry not in earlier):
            raise RenderingError(f"{self.path}: holds other things than pictures of a film: name another folder")
        self._making = self._together.enter_context(coming_together(self.path, earlier, refused=RenderingError))
        return self

    def wants(self, index: int) -> bool:
        """Every one."""
        return True

    def take(self, picture: Array, time: float) -> None:
        """Write the next picture."""
        write_png(self._making / f"frame_{self._count:04d}.png", picture)
        self._count += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Put them in their folder, in place of an older film."""
        self._together.__exit__(kind, error, trace)


def _is_picture(entry: Path) -> bool:
    return entry.is_file() and entry.name.startswith("frame_") and entry.suffix == ".png"
