"""Pictures as .png files: one, or a folder of them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.io.atomic import replacing

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
        self._beside = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._count = 0

    def __enter__(self) -> Self:
        """Make a folder beside the final one."""
        if self.path.is_dir() and any(not _is_picture(entry) for entry in self.path.iterdir()):
            raise RenderingError(f"{self.path}: holds other things than pictures of a film: name another folder")
        try:
            self._beside.mkdir(parents=True)
        except OSError as error:
            raise RenderingError(
                f"{self.path}: cannot be made a folder ({error.strerror}): choose another place"
            ) from None
        return self

    def wants(self, index: int) -> bool:
        """Every one."""
        return True

    def take(self, picture: Array, time: float) -> None:
        """Write the next picture."""
        write_png(self._beside / f"frame_{self._count:04d}.png", picture)
        self._count += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the folder its name, in place of an older one."""
        try:
            if error is None:
                if self.path.is_dir():
                    for entry in self.path.iterdir():
                        entry.unlink()
                    self.path.rmdir()
                self._beside.rename(self.path)
        finally:
            shutil.rmtree(self._beside, ignore_errors=True)


def _is_picture(entry: Path) -> bool:
    return entry.is_file() and entry.name.startswith("frame_") and entry.suffix == ".png"
