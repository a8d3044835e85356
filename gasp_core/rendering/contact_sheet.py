"""Key frames side by side on one picture: a film to be taken in at a glance."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError
from gasp_core.rendering.pictures import write_png

if TYPE_CHECKING:
    from typing import Self

__all__ = ["Sheet", "contact_sheet", "key_frames"]

Array = NDArray[Any]


class Sheet:
    """A picture of key frames in rows, each with its time under it.

    Parameters
    ----------
    path
        A .png file.
    title
        Stands above them.
    keys
        Numbers of the frames it shows.
    cell
        Largest width of a frame [px].
    """

    def __init__(self, path: Path, title: str, keys: Collection[int], cell: int = 480) -> None:
        self.path = path
        self._keys = frozenset(keys)
        self._title = title
        self._cell = cell
        self._cells: list[tuple[Array, float]] = []

    def __enter__(self) -> Self:
        """Nothing is written before the end."""
        return self

    def wants(self, index: int) -> bool:
        """Key frames alone."""
        return index in self._keys

    def take(self, picture: Array, time: float) -> None:
        """Keep a key frame, made small."""
        from PIL import Image

        image = Image.fromarray(picture)
        image.thumbnail((self._cell, 4 * self._cell), Image.Resampling.LANCZOS)
        self._cells.append((np.asarray(image), time))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Put the sheet together."""
        if error is None:
            if not self._cells:
                raise RenderingError(f"{self.path}: there is no picture to make a sheet of")
            write_png(self.path, contact_sheet(self._cells, self._title))


def contact_sheet(cells: Sequence[tuple[Array, float]], title: str) -> Array:
    """Pictures of one size with their times [s], in rows that make the sheet about as wide as a screen is."""
    from PIL import Image, ImageDraw, ImageFont

    height, width, channels = cells[0][0].shape
    columns = max(1, round((len(cells) * 1.6 * height / width) ** 0.5))
    rows = -(-len(cells) // columns)
    gap, line = max(4, width // 60), max(14, width // 18)
    size = (columns * (width + gap) + gap, rows * (height + gap + line) + gap + 2 * line)
    clear = channels == 4
    sheet = Image.new("RGBA" if clear else "RGB", size, (0, 0, 0, 0) if clear else "white")
    draw = ImageDraw.Draw(sheet)
    ink = "black"
    draw.text((gap, line // 2), title, fill=ink, font=ImageFont.load_default(size=line))
    for index, (picture, time) in enumerate(cells):
        x = gap + (index % columns) * (width + gap)
        y = gap + 2 * line + (index // columns) * (height + gap + line)
        sheet.paste(Image.fromarray(picture), (x, y))
        draw.text((x, y + height + 1), f"{time:.2f} s", fill=ink, font=ImageFont.load_default(size=0.75 * line))
    return np.asarray(sheet)


def key_frames(count: int, wanted: int = 12) -> list[int]:
    """Numbers of `wanted` frames spread evenly over `count`, first and last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(wanted, count))})
