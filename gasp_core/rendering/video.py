"""Pictures as a film."""

from __future__ import annotations

import contextlib
import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.errors import RenderingError

if TYPE_CHECKING:
    from typing import Self

__all__ = ["FilmFile"]

Array = NDArray[Any]

_QUALITY = "17"
"""Of x264 (constant rate factor): lower is better and larger; 17 can hardly be told from the pictures."""


class FilmFile:
    """An .mp4 file, H.264, by PyAV.

    Parameters
    ----------
    path
        Of the file.
    frame_rate
        Pictures a second.

    Raises
    ------
    RenderingError
        Where PyAV or its encoder is missing, a picture is transparent, or the file cannot be written.
    """

    def __init__(self, path: Path, frame_rate: float) -> None:
        self.path = path
        self._rate = Fraction(frame_rate).limit_denominator(1000)
        self._beside = path.with_name(f".{path.name}.{os.getpid()}.part")
        self._container: Any = None
        self._stream: Any = None

    def __enter__(self) -> Self:
        """Open the file beside its final name."""
        av = _av()
        try:
            self._container = av.open(str(self._beside), "w", format="mp4", options={"movflags": "+faststart"})
        except OSError as error:
            raise RenderingError(
                f"{self.path}: cannot be written ({error.strerror or error}): choose a folder that exists, is writable"
                " and has room"
            ) from None
        return self

    def wants(self, index: int) -> bool:
        """Every one."""
        return True

    def take(self, picture: Array, time: float) -> None:
        """Encode the next picture."""
        av = _av()
        if picture.shape[2] != 3:
            raise RenderingError(f"{self.path}: a film cannot be transparent: choose a background, or write pictures")
        picture = _even(picture)
        if self._stream is None:
            self._stream = self._begun(av, picture.shape[1], picture.shape[0])
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        # Said in the file and done to the pixels alike: players take what does not say for whatever they like.
        frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
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

    def _begun(self, av: Any, width: int, height: int) -> Any:
        try:
            stream = self._container.add_stream("libx264", rate=self._rate)
        except Exception as error:
            raise RenderingError(
                f"{self.path}: this build of PyAV has no H.264 encoder ({error}): write pictures (-o frames/), or"
                " pip install --force-reinstall av"
            ) from None
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"crf": _QUALITY, "preset": "medium"}
        context = stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = 1  # BT.709 in all three tables
        context.color_range = 1  # 16..235
        return stream

    def _mux(self, frame: Any) -> None:
        av = _av()
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except (OSError, av.FFmpegError) as error:
            raise RenderingError(f"{self.path}: the film cannot be written ({error})") from None


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
