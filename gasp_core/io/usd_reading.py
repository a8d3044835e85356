"""Reading USD: the splats (ParticleField3DGaussianSplat) of a stage, where it puts them, in metres.

USD reads in a process of its own, `gasp_core.io.usd_worker`, for what damaged files do to it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from gasp_core.gaussians import Gaussians
from gasp_core.io import usd_worker
from gasp_core.io.affine import flattens, moved
from gasp_core.io.format_errors import malformed, quoted, shown
from gasp_core.io.memory_limit import most_memory, refuse_too_large
from gasp_core.io.spz import turned
from gasp_core.io.stacked import in_unit_range, stacked
from gasp_core.io.usd import READ_SUFFIXES

__all__ = ["read_usd"]

Array = NDArray[Any]

_LEAST = 40 << 20
"""Bytes that USD wants for any stage."""
_LONGEST_ANSWER = 1 << 26
_DEGREES = range(5)
# From z up to y down: x stays, y goes away from the viewer. As `turned` is from y up.
_FROM_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def read_usd(path: Path, size: int) -> tuple[Gaussians, str]:
    """Gaussians of all splats that a stage shows, right-down-front, and what is said of the format.

    Where it moves, they are as in its first frame.

    Raises
    ------
    SplatFormatError
        Where usd-core is not installed, or it holds no splat, is damaged, or is made of other files too.
    """
    if path.suffix.lower() not in READ_SUFFIXES:
        raise malformed(path, "is a stage of USD by another name", f"call it {' or '.join(READ_SUFFIXES)}")
    if find_spec("pxr") is None:
        raise malformed(path, "reading USD takes another package", 'install it: pip install "gasp-core[usd]"')
    most = max(_LEAST, most_memory(path, size))
    command = [sys.executable, "-P", "-m", usd_worker.__name__, str(path.absolute()), str(most)]
    # Threads would each have a stack, which counts as memory.
    around = {**os.environ, "PXR_WORK_THREAD_LIMIT": "1", "OPENBLAS_NUM_THREADS": "1"}
    around["PYTHONPATH"] = os.pathsep.join(entry for entry in sys.path if entry)
    with subprocess.Popen(
        command, env=around, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        try:
            return _answered(cast("IO[bytes]", process.stdout), path, size)
        finally:
            process.kill()


def _answered(stream: IO[bytes], path: Path, size: int) -> tuple[Gaussians, str]:
    line = stream.readline(_LONGEST_ANSWER)
    try:
        said: Any = json.loads(line)
    except ValueError:
        raise malformed(path, "is no whole stage of USD, or takes too long to read") from None
    if "refused" in said:
        raise malformed(path, *(shown(part) for part in said["refused"]))
    splats = said["splats"]
    if not splats:
        if said["meshes"]:
            raise malformed(
                path, "holds meshes, no splat", "export the mesh as .glb; of one `gasp convert` makes a splat"
            )
        raise malformed(path, "shows no ParticleField3DGaussianSplat, so no splat", "export it anew")
    unit, up = said["unit"], said["up"]
    if not (np.isfinite(unit) and unit > 0) or up not in ("Y", "Z"):
        raise malformed(path, f"has {quoted(up)} for its upAxis and {unit:.3g} for metersPerUnit", "mend it")
    total, bases = sum(splat["rows"]["positions"] for splat in splats), max(_bases(splat, path) for splat in splats)
    refuse_too_large(path, size, total, bases)
    pieces: list[Gaussians] = []
    for splat in splats:
        place = np.diag([unit, unit, unit, 1.0]) @ np.array(splat["place"])
        if flattens(place):
            raise malformed(
                path, f"squeezes {quoted(splat['path'])} to nothing, or beyond all bounds", "mend its xform"
            )
        pieces.append(moved(_splat(stream, splat, path), _FROM_Z @ place if up == "Z" else place))
    whole = stacked(pieces)
    return whole if up == "Z" else turned(whole), "usd, its first frame" if said["moves"] else "usd"


def _bases(splat: dict[str, Any], path: Path) -> int:
    """Harmonics of each Gaussian, where all its rows are as many as they must be."""
    rows, degree = splat["rows"], splat["degree"]
    if degree not in _DEGREES:
        raise malformed(path, f"has harmonics of degree {degree}", "degrees 0 to 4 are read")
    count, bases = rows["positions"], (degree + 1) ** 2
    for name, found in rows.items():
        wanted = count * bases if name == "harmonics" else count
        if found != wanted:
            attribute = usd_worker.FIELDS[name][0]
            raise malformed(
                path, f"has {found:,} of {attribute} for {count:,} positions of {quoted(splat['path'])}, not {wanted:,}"
            )
    return bases


def _splat(stream: IO[bytes], splat: dict[str, Any], path: Path) -> Gaussians:
    """Gaussians of a splat, in its own frame and unit."""
    found: dict[str, Array] = {}
    for name, rows in splat["rows"].items():
        width = usd_worker.FIELDS[name][1]
        content = stream.read(4 * rows * width)
        if len(content) != 4 * rows * width:
            raise malformed(path, "could not be read to its end", "try again")
        found[name] = np.frombuffer(content, "<f4").reshape(rows, width).astype(np.float32)
    if np.any(found["scales"] < 0):
        raise malformed(path, "has negative scales, perhaps logarithms of them", "export it anew: USD's are linear")
    return Gaussians(
        means=found["positions"],
        quaternions=np.roll(found["orientations"], 1, axis=1),
        scales=found["scales"],
        opacities=in_unit_range(found["opacities"][:, 0], path),
        harmonics=found["harmonics"].reshape(len(found["positions"]), -1, 3),
    )
