"""The splats of a scene, read and put where they are at its start."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gasp_core.dynamics.composition import Played, play
from gasp_core.dynamics.d_miso.checkpoint import read_checkpoint
from gasp_core.dynamics.frame_sequence import frame_files
from gasp_core.dynamics.function_motion import function_digest
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat
from gasp_core.io.detect import whole
from gasp_core.io.digests import add_content
from gasp_core.scene.columns import column_digest
from gasp_core.scene.file_digests import file_digest
from gasp_core.scene.model import Scene
from gasp_core.scene.motions import DMiSoMotion, FrameSequence, Motion, PythonMotion
from gasp_core.scene.objects import SplatObject, columns_of
from gasp_core.scene.selection import PlacedObject, place_object
from gasp_core.scene.writing import gaussians_digest

__all__ = ["PlacedScene", "place_scene", "read_source"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedScene:
    """The objects of a scene in the world, their harmonics of one degree.

    Parameters
    ----------
    objects
        In the order of the scene.
    digests
        SHA-256 of each object's source.
    motions
        Of those that move by themselves, by name.
    """

    objects: tuple[PlacedObject, ...]
    digests: tuple[str, ...]
    motions: Mapping[str, Played]

    @property
    def gaussians(self) -> Gaussians:
        """All that is drawn, object by object."""
        parts = [placed.gaussians for placed in self.objects]
        names = [field.name for field in dataclasses.fields(Gaussians)]
        return Gaussians(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def place_scene(scene: Scene) -> PlacedScene:
    """Read, select and place the splats of a scene.

    Raises
    ------
    SceneError, SplatFormatError
        Where a splat cannot be read, or nothing of it is left.
    """
    objects: list[PlacedObject] = []
    digests: list[str] = []
    motions: dict[str, Played] = {}
    for item in scene.objects:
        gaussians, digest = read_source(item)
        if item.motion is None:
            objects.append(place_object(item, gaussians))
        else:
            placed, motions[item.name] = play(item, gaussians, scene.maps)
            objects.append(placed)
        digests.append(digest)
    degree = max(placed.gaussians.sh_degree for placed in objects)
    return PlacedScene(
        objects=tuple(_raised(placed, degree) for placed in objects), digests=tuple(digests), motions=motions
    )


def read_source(item: SplatObject) -> tuple[Gaussians, str]:
    """The Gaussians of an object, of what is trained to move those at the first time, and the digest of all of it."""
    gaussians, digest = _read_splat_and_motion(item)
    digests = [found for column in columns_of(item) if (found := column_digest(column))]
    if item.reduction.mesh is not None:
        digests.append(file_digest(item.reduction.mesh))
    if digests:
        digest = hashlib.sha256(" ".join([digest, *digests]).encode()).hexdigest()
    return gaussians, digest


def _read_splat_and_motion(item: SplatObject) -> tuple[Gaussians, str]:
    """The Gaussians, and the digest of where they and psi come from."""
    if isinstance(item.motion, PythonMotion):
        gaussians, own = _read(item.splat, None)
        return gaussians, hashlib.sha256(f"{own} {function_digest(item.motion.function)}".encode()).hexdigest()
    return _read(item.splat, item.motion)


def _read(splat: Path | Gaussians, motion: Motion | None) -> tuple[Gaussians, str]:
    if isinstance(splat, Gaussians):
        return splat, gaussians_digest(splat)
    digest = hashlib.sha256()
    if isinstance(motion, DMiSoMotion):
        checkpoint, files = read_checkpoint(splat, motion.iteration)
        for file in files.all():
            add_content(digest, file)
        return checkpoint.at(0.0), digest.hexdigest()
    first = frame_files(splat)[0] if isinstance(motion, FrameSequence) else splat
    gaussians = read_splat(first)
    add_content(digest, whole(splat))
    return gaussians, digest.hexdigest()


def _raised(placed: PlacedObject, degree: int) -> PlacedObject:
    """An object whose harmonics are filled up with zeros to a degree, so that all objects share one array."""
    if placed.gaussians.sh_degree == degree:
        return placed
    harmonics = placed.gaussians.harmonics
    missing = (degree + 1) ** 2 - harmonics.shape[1]
    zeros = np.zeros((len(harmonics), missing, 3), dtype=harmonics.dtype)
    raised = placed.gaussians.with_(harmonics=np.concatenate([harmonics, zeros], axis=1))
    return dataclasses.replace(placed, gaussians=raised)
