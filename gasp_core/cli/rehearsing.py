"""Kernels compiled ahead of a first run, in processes beside it.

On a machine that has never run GASP, Numba compiles for most of a minute, and the engine for some seconds more. None of
it needs the scene: while a run reads its splats and starts its engine, a toy is moved and painted elsewhere, and what
that compiled is found on disk.

`python -m gasp_core.cli.rehearsing PART` is one of these processes.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

from gasp_core.processes import guard

if TYPE_CHECKING:
    from gasp_core.scene.model import Scene

__all__ = ["PARTS", "leave_mark", "main", "rehearsed"]

PARTS = ("motion", "pictures")
"""What is rehearsed, each in a process of its own."""
_COMPILERS = ("gasp-core", "gasp-renderer", "numba", "llvmlite", "numpy")
_TOY = 600
"""Gaussians of the toy: enough for a body inside."""


@contextmanager
def rehearsed() -> Generator[None]:
    """Have kernels compiled meanwhile that nobody has compiled on this machine; what is not done in the end is ended.

    Nothing is where nothing may be kept (`GASP_CACHE`), or where there is one processor.
    """
    processes = [_started(part) for part in PARTS if _is_wanted(part)] if (os.cpu_count() or 1) > 1 else []
    try:
        yield
    finally:
        for process in processes:
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    from gasp_core.processes.group import kill_group

    kill_group(process)
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


def _started(part: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", guard.__name__, __name__, part],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _is_wanted(part: str) -> bool:
    mark = _mark(part)
    return mark is not None and not mark.exists()


def _mark(part: str) -> Path | None:
    """A file that is there once a part has been rehearsed with these compilers, on a machine of this name."""
    from gasp_core.io.cache_folders import cache_folder

    folder = cache_folder("rehearsed")
    if folder is None:
        return None
    words = [part, platform.python_version(), platform.machine(), platform.node()]
    words += [os.environ.get("NUMBA_CACHE_DIR", ""), str(Path(__file__).parent)]
    for name in _COMPILERS:
        with contextlib.suppress(PackageNotFoundError):
            words.append(f"{name} {version(name)}")
    return folder / hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def main(part: str) -> None:
    """Rehearse a part, and leave a mark that it has been done."""
    from gasp_core.processes.scratch import scratch_folder

    guard.read_nothing()
    try:
        with scratch_folder("gasp-rehearsal-") as folder:
            {"motion": _move, "pictures": _paint}[part](_scene(folder), folder)
    finally:
        # Also where it went wrong: what is tried at every run costs more than it is worth.
        leave_mark(part)


def leave_mark(part: str) -> None:
    """Take a part for rehearsed from now on, where anything may be kept."""
    mark = _mark(part)
    if mark is not None:
        with contextlib.suppress(OSError):
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.touch()


def _scene(folder: Path) -> Scene:
    """A toy above a floor, as solid as what is run."""
    from gasp_core.contract import Collider, Elastic, HalfSpace
    from gasp_core.io import write_splat
    from gasp_core.scene.model import Scene
    from gasp_core.scene.objects import Reduction, SplatObject
    from gasp_core.toy import make_toy

    write_splat(folder / "toy.ply", make_toy(_TOY))
    toy = SplatObject(
        name="toy",
        splat=folder / "toy.ply",
        height=0.3,
        position=(0.0, 0.0, 0.1),
        material=Elastic(density=400.0, youngs_modulus=5e4, poissons_ratio=0.3),
        reduction=Reduction(mode="volume"),
    )
    floor = Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)))
    return Scene(duration=0.1, frame_rate=10, objects=(toy,), colliders=(floor,))


def _move(scene: Scene, folder: Path) -> None:
    """What happens to a body in every frame."""
    import numpy as np

    from gasp_core.reduction.bodies import matter_turns, moved_gaussians
    from gasp_core.reduction.shape_flags import shape_flags
    from gasp_core.simulation.splat_sources import prepare

    assembly = prepare(scene).assembly
    everywhere = 1e-3 * np.sin(assembly.problem.points.reference_positions)
    for body in assembly.bodies:
        displacements = everywhere[body.points]
        shape_flags(body, displacements, scene.maps, None)
        matter_turns(body, moved_gaussians(body, displacements, scene.maps))


def _paint(scene: Scene, folder: Path) -> None:
    from gasp_core import render

    render(scene, folder / "toy.png", size=(64, 36), progress=False)


if __name__ == "__main__":
    main(sys.argv[1])
