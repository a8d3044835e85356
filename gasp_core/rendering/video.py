"""Pictures as a film: .mp4, .webm, .gif."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError

if TYPE_CHECKING:
    from typing import Self

__all__ = ["FILMS", "FilmFile"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Codec:
    """How films of an ending are stored.

    Parameters
    ----------
    name, container
        As FFmpeg calls them.
    options
        Of the encoder.
    opaque, clear
        How pixels are stored, without and with transparency; clear: "" where there is none.
    called
        For messages.
    muxing
        Options of the container.
    """

    name: str
    container: str
    options: Mapping[str, str]
    opaque: str
    clear: str
    called: str
    muxing: Mapping[str, str]


FILMS: dict[str, _Codec] = {
    ".mp4": _Codec(
        name="libx264",
        container="mp4",
        # Constant rate factor: lower is better and larger; 17 can hardly be told from the pictures.
        options={"crf": "17", "preset": "medium"},
        opaque="yuv420p",
        clear="",
        called="H.264",
        muxing={"movflags": "+faststart"},
    ),
    ".webm": _Codec(
        name="libvpx-vp9",
        container="webm",
        options={"crf": "24", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "1", "auto-alt-ref": "0"},
        opaque="yuv420p",
        clear="yuva420p",
        called="VP9",
        muxing={},
    ),
    ".gif": _Codec(
        name="gif", container="gif", options={}, opaque="pal8", clear="pal8", called="GIF", muxing={"loop": "0"}
    ),
}
"""By the ending of the file's name."""

_GIF_RATE = 50
"""Pictures a second that browsers show of a .gif; faster ones they slow down to ten."""
_ROUNDED = 1e-9
"""By which a rate may be larger for its last digits alone, as 5.5 over 0.11 is."""


class FilmFile:
    """A film, by PyAV; a .gif has every so manieth picture only, where there are more a second than browsers show.

    Parameters
    ----------
    path
        Of the file; its ending is one of `FILMS`.
    frame_rate
        Pictures a second.

    Raises
    ------
    RenderingError
        Where PyAV or its encoder is missing, a picture is transparent and the film cannot be, or the file cannot be
        written.
    """

    def __init__(self, path: Path, frame_rate: float) -> None:
        self.path = path
        self._codec = FILMS[path.suffix.lower()]
        self._every = max(1, math.ceil(frame_rate / _GIF_RATE - _ROUNDED)) if self._codec.name == "gif" else 1
        self._rate = _fraction(frame_rate / self._every)
        self._beside = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._container: Any = None
        self._stream: Any = None
        self._graph: Any = None
        self._count = 0

    def __enter__(self) -> Self:
        """Open the file beside its final name."""
        av = _av()
        codec = self._codec
        try:
            self._container = av.open(str(self._beside), "w", format=codec.container, options=dict(codec.muxing))
        except OSError as error:
            raise RenderingError(
                f"{self.path}: cannot be written ({error.strerror or error}): choose a folder that exists, is writable"
                " and has room"
            ) from None
        return self

    def wants(self, index: int) -> bool:
        """Every one, or every so manieth."""
        return index % self._every == 0

    def take(self, picture: Array, time: float) -> None:
        """Encode the next picture."""
        av = _av()
        clear = picture.shape[2] == 4
        if clear and not self._codec.clear:
            raise RenderingError(
                f"{self.path}: such a film cannot be transparent: choose a background, a .webm, or write pictures"
            )
        picture = np.ascontiguousarray(picture if self._codec.name == "gif" else _even(picture))
        stored = self._codec.clear if clear else self._codec.opaque
        if self._stream is None:
            self._stream = self._begun(av, picture.shape[1], picture.shape[0], stored)
        frame = av.VideoFrame.from_ndarray(picture, format="rgba" if clear else "rgb24")
        if self._codec.name == "gif":
            frame = self._with_palette(av, frame)
        else:
            # Said in the file and done to the pixels alike: players take what does not say for whatever they like.
            frame = frame.reformat(format=stored, dst_colorspace="ITU709", dst_color_range="MPEG")
        frame.pts, frame.time_base = self._count, 1 / self._rate
        self._count += 1
        self._mux(frame)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file, or remove what there is of it."""
        try:
            if error is None:
                if self._stream is None:
                    raise RenderingError(f"{self.path}: there is no picture to make a film of")
                self._mux(None)
            self._container.close()
            if error is None:
                self._beside.replace(self.path)
        finally:
            with contextlib.suppress(OSError):
                self._beside.unlink(missing_ok=True)

    def _begun(self, av: Any, width: int, height: int, stored: str) -> Any:
        codec = self._codec
        try:
            stream = self._container.add_stream(codec.name, rate=self._rate)
        except Exception as error:
            raise RenderingError(
                f"{self.path}: this build of PyAV has no {codec.called} encoder ({error}): write pictures (-o frames/),"
                " or pip install --force-reinstall av"
            ) from None
        stream.width, stream.height, stream.pix_fmt = width, height, stored
        stream.options = dict(codec.options)
        if codec.name != "gif":
            context = stream.codec_context
            context.colorspace = context.color_primaries = context.color_trc = 1  # BT.709 in all three tables
            context.color_range = 1  # 16..235
        return stream

    def _with_palette(self, av: Any, frame: Any) -> Any:
        if self._graph is None:
            graph = av.filter.Graph()
            source = graph.add_buffer(
                width=frame.width, height=frame.height, format=frame.format.name, time_base=1 / self._rate
            )
            # A palette of its own for every picture: none has to wait for the last one.
            split = graph.add("split")
            palette, use = (
                graph.add("palettegen", "stats_mode=single"),
                graph.add("paletteuse", "new=1:dither=sierra2_4a"),
            )
            sink = graph.add("buffersink")
            source.link_to(split)
            split.link_to(palette, 0, 0)
            split.link_to(use, 1, 0)
            palette.link_to(use, 0, 1)
            use.link_to(sink)
            graph.configure()
            self._graph = graph
        frame.pts, frame.time_base = self._count, 1 / self._rate
        self._graph.push(frame)
        return self._graph.pull()

    def _mux(self, frame: Any) -> None:
        av = _av()
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except (OSError, av.FFmpegError) as error:
            raise RenderingError(f"{self.path}: the film cannot be written ({error})") from None


def _fraction(rate: float) -> Fraction:
    """A rate as films have it; of less than one picture a second, the time that each is seen."""
    return Fraction(rate).limit_denominator(1000) if rate >= 1 else 1 / Fraction(1 / rate).limit_denominator(1000)


def _even(picture: Array) -> Array:
    """With the last row and column twice where their number is odd: colour is stored for every other pixel."""
    height, width = picture.shape[:2]
    return (
        np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge") if height % 2 or width % 2 else picture
    )


def _av() -> Any:
    try:
        import av
    except ImportError as error:
        raise RenderingError(
            f"films need PyAV, which cannot be imported ({error}): pip install av, or write pictures (-o frames/)"
        ) from None
    return av
