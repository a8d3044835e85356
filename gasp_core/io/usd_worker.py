"""A process that reads a stage of USD and says what Gaussians it holds.

USD's parsers trust what they read: of damaged .usdc some end the process, take memory without bound or never end. So
they run in a process of its own, whose memory and time are limited, and which is started by `gasp_core.io.usd_reading`.
It answers with a line of JSON and the numbers behind it.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Generator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FIELDS", "main"]

Array = NDArray[Any]

FIELDS = {
    "positions": ("positions", 3),
    "orientations": ("orientations", 4),
    "scales": ("scales", 3),
    "opacities": ("opacities", 1),
    "harmonics": ("radiance:sphericalHarmonicsCoefficients", 3),
}
"""Of a splat: the attribute, whose name with an h behind it is that of its half-precision kin, and numbers of a row."""

_SPLAT = "ParticleField3DGaussianSplat"
_HIDDEN = ("proxy", "guide")
_MOST_PRIMS = 100_000
_SECONDS = 5
"""Of processor time, and one more for each megabyte of the file."""
_LONGER = 12
"""Times as long by the clock: what has no memory left may wait for ever."""


class _RefusedError(Exception):
    """What is wrong, and what to do."""


def main(path: str, most: int) -> None:
    """Answer for a file, taking no more than `most` bytes of memory beside what USD itself takes."""
    # USD may print, and only the answer is to be on stdout.
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)
        values: list[Array] = []
        try:
            said = _told(path, most, values)
        except _RefusedError as error:
            said = {"refused": list(error.args)}
        except MemoryError:
            said = {"refused": ["would take more memory than its size can honestly mean, or than there is"]}
        answer.write(json.dumps(said).encode() + b"\n")
        for array in values:
            answer.write(np.ascontiguousarray(array, dtype="<f4").data)


def _told(path: str, most: int, values: list[Array]) -> dict[str, Any]:
    Sdf, Tf, Usd, UsdGeom = (import_module(f"pxr.{name}") for name in ("Sdf", "Tf", "Usd", "UsdGeom"))
    _limit(most, Path(path).stat().st_size)
    try:
        layer: Any = Sdf.Layer.FindOrOpen(path)
        if not layer:
            raise _RefusedError("is no whole stage of USD")
        _refuse_others(layer)
        stage: Any = Usd.Stage.Open(layer)
        if not stage:
            raise _RefusedError("is no whole stage of USD")
        starts = stage.HasAuthoredTimeCodeRange()
        time = Usd.TimeCode(stage.GetStartTimeCode()) if starts else Usd.TimeCode.EarliestTime()
        places = UsdGeom.XformCache(time)
        splats: list[dict[str, Any]] = []
        moves = False
        for prim in _splats(stage, UsdGeom, time):
            rows = _values(prim, time)
            if not len(rows["positions"]):
                continue
            attributes = [prim.GetAttribute(f"{name}{half}") for name, _ in FIELDS.values() for half in ("", "h")]
            moves |= any(attribute and attribute.GetNumTimeSamples() > 1 for attribute in attributes)
            degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree")
            splats.append(
                {
                    "path": str(prim.GetPath()),
                    "place": np.array(places.GetLocalToWorldTransform(prim)).T.tolist(),
                    # The schema's fallback, which a USD that knows no splats does not have.
                    "degree": degree.Get() if degree and degree.HasValue() else 3,
                    "rows": {name: len(found) for name, found in rows.items()},
                }
            )
            values += rows.values()
        return {
            "splats": splats,
            "up": str(UsdGeom.GetStageUpAxis(stage)),
            "unit": float(UsdGeom.GetStageMetersPerUnit(stage)),
            "moves": moves,
            "meshes": not splats and any(prim.GetTypeName() == "Mesh" for prim in stage.Traverse()),
        }
    except Tf.ErrorException as error:
        raise _RefusedError("is no whole stage of USD") from error


def _limit(most: int, size: int) -> None:
    """Let this process take so much more memory than it has now, and a time that goes with the file's size [B]."""
    try:
        resource: Any = import_module("resource")
        held = Path("/proc/self/status").read_text(encoding="ascii").partition("VmData:")[2].split()
    except (ImportError, OSError):
        return
    allowed = int(held[0]) * 1024 + most
    used, seconds = resource.getrusage(resource.RUSAGE_SELF), _SECONDS + (size >> 20)
    signal.alarm(_LONGER * seconds)
    seconds += int(used.ru_utime + used.ru_stime) + 1
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (allowed, allowed))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _refuse_others(layer: Any) -> None:
    """Refuse a stage that is made of other files too: nothing is opened but what was named."""
    # A reference within the stage names no file.
    others = sorted(name for name in layer.GetCompositionAssetDependencies() if name)
    paths: list[Any] = []
    layer.Traverse("/", paths.append)
    for path in paths:
        found = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if found and found.HasInfo("clips"):
            others.append("clips")
    if others:
        raise _RefusedError(
            f"is made of other files too, such as {others[0][:60]!r}", "make one of them: usdcat --flatten"
        )


def _splats(stage: Any, UsdGeom: Any, time: Any) -> Generator[Any]:
    """Prims that are splats and shown."""
    Usd = import_module("pxr.Usd")
    for number, prim in enumerate(stage.Traverse(Usd.TraverseInstanceProxies())):
        if number >= _MOST_PRIMS:
            raise _RefusedError(f"has more than {_MOST_PRIMS:,} prims", "write the splat into a stage of its own")
        if prim.GetTypeName() != _SPLAT:
            continue
        seen: Any = UsdGeom.Imageable(prim)
        if seen.ComputeVisibility(time) != "invisible" and seen.ComputePurpose() not in _HIDDEN:
            yield prim


def _values(prim: Any, time: Any) -> dict[str, Array]:
    """What a splat says of its Gaussians, rows of the width of each field; half precision where there is no other."""
    found: dict[str, Array] = {}
    for name, (attribute, width) in FIELDS.items():
        held = None
        for kin in (attribute, f"{attribute}h"):
            one = prim.GetAttribute(kin)
            held = one.Get(time) if one else None
            if held is not None and len(held):
                break
        # Its quaternions lie in memory with the real part last.
        rows = np.array(held) if held is not None else np.empty(0)
        if rows.dtype.kind != "f" or rows.size % width:
            raise _RefusedError(f"has something else for {attribute} of {prim.GetPath()}")
        found[name] = rows.astype(np.float32).reshape(-1, width)
    return found


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
