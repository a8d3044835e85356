"""Writing USD: Gaussians as ParticleField3DGaussianSplat, still or with a sample a frame.

The schema came with USD 26.3. Scales are linear, harmonics are ordered as everywhere here, a unit is a metre.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io.format_errors import malformed
from gasp_core.io.rotations import unit_quaternions
from gasp_core.io.spz import turned

__all__ = ["READ_SUFFIXES", "USD_SUFFIXES", "SplatStage", "is_usd", "splat_stage", "write_usd"]

Array = NDArray[Any]

USD_SUFFIXES = (".usdc", ".usda", ".usd")
"""Packed, as text, and packed again."""
READ_SUFFIXES = (*USD_SUFFIXES, ".usdz")
"""What is read: the last is a zip of one of these."""

_ROOT = "/splats"
_MAGICS = (b"PXR-USDC", b"#usda 1.")
_ZIP, _NAME_OF_FIRST = b"PK\x03\x04", 30
_SAVED_EVERY = 50
"""Frames: what is saved is no longer held in memory."""
_REACH = 3.0
"""Standard deviations that a Gaussian is taken to reach, as the schema has it."""


def is_usd(head: bytes) -> bool:
    """Whether a file is a stage, by its first hundred bytes: text, packed, or a zip whose first file is one."""
    if head.startswith(_ZIP):
        length = int.from_bytes(head[26:28], "little")
        return head[_NAME_OF_FIRST : _NAME_OF_FIRST + length].lower().endswith((b".usdc", b".usda", b".usd"))
    return head.startswith(_MAGICS)


def write_usd(path: Path, gaussians: Gaussians) -> None:
    """Write finite Gaussians, right-down-front, as a stage whose y is up.

    Raises
    ------
    SplatFormatError
        As `splat_stage`.
    """
    with splat_stage(path, up_axis="Y") as stage:
        stage.add(0, {path.stem: turned(gaussians)})


@contextmanager
def splat_stage(path: Path, *, up_axis: Literal["Y", "Z"], frame_rate: float | None = None) -> Generator[SplatStage]:
    """A stage beside `path` that takes its place when the block ends well, and vanishes otherwise.

    Parameters
    ----------
    path
        Ends in one of `USD_SUFFIXES`.
    up_axis
        Of what is going to be written.
    frame_rate
        Samples a second; None: it stands still.

    Raises
    ------
    SplatFormatError
        Where usd-core is not installed, or the disk refuses.
    """
    try:
        Tf = _module("Tf")
    except ImportError as error:
        raise malformed(
            path, "writing USD takes another package", 'install it: pip install "gasp-core[usd]"'
        ) from error
    if path.is_dir():
        raise malformed(path, "cannot be written, it is a folder", "name a file")
    if not path.parent.is_dir():
        # USD would make it.
        raise malformed(path, "cannot be written: there is no such folder", "choose one that exists")
    beside = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        stage = SplatStage(beside, up_axis, frame_rate)
        yield stage
        stage.close()
        beside.replace(path)
    except (OSError, Tf.ErrorException) as error:
        reason = error.strerror if isinstance(error, OSError) else "USD says that it cannot"
        raise malformed(
            path, f"cannot be written: {reason}", "choose a folder that exists, is writable and has room"
        ) from error
    finally:
        with suppress(OSError):
            beside.unlink()


class SplatStage:
    """A stage of splats that is being written; use `splat_stage`."""

    def __init__(self, path: Path, up_axis: Literal["Y", "Z"], frame_rate: float | None) -> None:
        Usd, UsdGeom = _module("Usd"), _module("UsdGeom")
        if not hasattr(_module("UsdVol"), "ParticleField3DGaussianSplat"):
            raise malformed(path, "usd-core is older than 26.3, which knows no splats", "update usd-core")
        if path.exists():
            path.unlink()
        self._stage: Any = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(self._stage, up_axis)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        self._stage.SetDefaultPrim(UsdGeom.Xform.Define(self._stage, _ROOT).GetPrim())
        self._moves = frame_rate is not None
        if frame_rate is not None:
            self._stage.SetTimeCodesPerSecond(frame_rate)
            self._stage.SetFramesPerSecond(frame_rate)
        self._frames: list[int] = []
        self._fields: dict[str, Any] = {}
        self._written: dict[str, dict[str, Array]] = {}

    def add(self, frame: int, splats: Mapping[str, Gaussians]) -> None:
        """Write a frame; what has not changed since the last one is not written again.

        Parameters
        ----------
        frame
            Its number, the time code.
        splats
            Float32 is kept of them. By the name of the object, which is made one that USD takes.
        """
        for name in {**self._fields, **splats}:
            if name not in self._fields:
                self._define(name, splats[name].sh_degree)
            self._set(frame, name, _values(splats.get(name)))
        self._frames.append(frame)
        if len(self._frames) % _SAVED_EVERY == 0:
            self._stage.GetRootLayer().Save()

    def close(self) -> None:
        """Write what is not written yet."""
        if self._moves and self._frames:
            self._stage.SetStartTimeCode(self._frames[0])
            self._stage.SetEndTimeCode(self._frames[-1])
        if not self._stage.GetRootLayer().Save():
            raise OSError("the disk refuses")

    def _define(self, name: str, degree: int) -> None:
        wanted = _module("Tf").MakeValidIdentifier(name)
        taken = {field.GetPrim().GetName() for field in self._fields.values()}
        free = next(one for one in (wanted, *(f"{wanted}_{k}" for k in range(2, len(taken) + 3))) if one not in taken)
        field: Any = _module("UsdVol").ParticleField3DGaussianSplat.Define(self._stage, f"{_ROOT}/{free}")
        if free != name:
            field.GetPrim().SetDisplayName(name)
        field.CreateRadianceSphericalHarmonicsDegreeAttr(degree)
        self._fields[name] = field
        # It was not there until now.
        self._written[name] = _values(None) if self._frames else {}

    def _set(self, frame: int, name: str, values: dict[str, Array]) -> None:
        """Write what has changed: what never does is no sample."""
        Usd = _module("Usd")
        written = self._written[name]
        for key, held in values.items():
            before = written.get(key)
            if before is not None and np.array_equal(before, held):
                continue
            attribute, kind = self._attribute(name, key)
            if before is not None:
                # Values between samples are interpolated: it stood still from the first frame, or until the last one.
                samples = attribute.GetTimeSamples()
                for time in {self._frames[0], self._frames[-1]} if not samples else {self._frames[-1]}:
                    if time not in samples:
                        attribute.Set(kind.FromNumpy(before), Usd.TimeCode(time))
                attribute.ClearDefault()
                attribute.Set(kind.FromNumpy(held), Usd.TimeCode(frame))
            else:
                attribute.Set(kind.FromNumpy(held))
            written[key] = held

    def _attribute(self, name: str, key: str) -> tuple[Any, Any]:
        """The attribute, and the array that it takes."""
        Vt = _module("Vt")
        field = self._fields[name]
        create, kind = {
            "positions": (field.CreatePositionsAttr, Vt.Vec3fArray),
            "orientations": (field.CreateOrientationsAttr, Vt.QuatfArray),
            "scales": (field.CreateScalesAttr, Vt.Vec3fArray),
            "opacities": (field.CreateOpacitiesAttr, Vt.FloatArray),
            "harmonics": (field.CreateRadianceSphericalHarmonicsCoefficientsAttr, Vt.Vec3fArray),
            "extent": (field.CreateExtentAttr, Vt.Vec3fArray),
        }[key]
        return create(), kind


def _values(gaussians: Gaussians | None) -> dict[str, Array]:
    """What is written of them, float32; of none, empty arrays."""
    if gaussians is None:
        widths = {"positions": 3, "orientations": 4, "scales": 3, "harmonics": 3}
        found = {key: np.zeros((0, width), dtype=np.float32) for key, width in widths.items()}
        return {
            **found,
            "opacities": np.zeros(0, dtype=np.float32),
            "extent": np.zeros((2, 3), dtype=np.float32),
        }
    reach = _REACH * gaussians.scales.max(axis=1, keepdims=True)
    values = {
        "positions": gaussians.means,
        # A quaternion of USD lies in memory with its real part last.
        "orientations": np.roll(unit_quaternions(gaussians.quaternions), -1, axis=1),
        "scales": gaussians.scales,
        "opacities": np.clip(gaussians.opacities, 0, 1),
        "harmonics": gaussians.harmonics.reshape(-1, 3),
        "extent": np.stack([(gaussians.means - reach).min(axis=0), (gaussians.means + reach).max(axis=0)]),
    }
    return {key: np.ascontiguousarray(value, dtype=np.float32) for key, value in values.items()}


def _module(name: str) -> Any:
    """A module of USD, whose names are known only when it runs."""
    return import_module(f"pxr.{name}")
