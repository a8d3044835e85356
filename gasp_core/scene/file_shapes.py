"""Shapes of colliders that files describe: splats by the solid behind them, triangle meshes."""

from __future__ import annotations

import dataclasses
import functools
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider, SignedDistanceField
from gasp_core.contract.validation import Vector, finite_vector, positive, whole_number
from gasp_core.errors import SceneError
from gasp_core.io import read_splat
from gasp_core.io.format_errors import shown
from gasp_core.io.meshes import read_mesh
from gasp_core.scene.file_digests import file_digest
from gasp_core.scene.objects import UP_AXES, SplatObject, UpAxis, check_rotation
from gasp_core.scene.placement import similarity, whole_box
from gasp_core.scene.selection import place_object
from gasp_core.scene.solid_fields import field_of
from gasp_core.solid.mesh_distance import field_of_mesh
from gasp_core.solid.options import SolidOptions

__all__ = ["FileShape", "MeshShape", "SplatShape", "known_by_content", "resolved"]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileShape(ABC):
    """A region of space that a file describes; what it is, is looked up when a scene is prepared.

    A kind of its own says how, in `resolve`.

    Parameters
    ----------
    file
        Where it is.
    up
        The file's axis that becomes +z. None: "-y" for splats, "+y" for .glb, "+z" for other meshes.
    height, metres_per_unit, position, rotation
        As of `SplatObject`; of a mesh the box is that of all its vertices.
    sha256
        Of the file's content: another one is refused. Recordings say it, so that a run is gone on with among the same
        colliders. Empty: whatever is there.
    """

    kind: ClassVar[str] = ""
    file: Path
    up: UpAxis | None = None
    height: float | None = None
    metres_per_unit: float | None = None
    position: Vector | None = None
    rotation: tuple[float, ...] | None = None
    sha256: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", Path(self.file))
        if self.up not in (None, *UP_AXES):
            raise SceneError(f"{type(self).__name__}.up must be one of {', '.join(UP_AXES)}, found {self.up!r}")
        if self.height is not None and self.metres_per_unit is not None:
            raise SceneError(
                f"{type(self).__name__}.height and metres_per_unit contradict each other: give one of them"
            )
        positive(self, *(name for name in ("height", "metres_per_unit") if getattr(self, name) is not None))
        if self.position is not None:
            finite_vector(self, "position")
        if self.rotation is not None:
            check_rotation(self)

    @abstractmethod
    def resolve(self) -> SignedDistanceField:
        """The region as engines understand it."""

    def signed_distance(self, positions: Array) -> Array:
        """Of positions (N, 3) [m]."""
        return _field_of(self).signed_distance(positions)

    def outward_normal(self, positions: Array) -> Array:
        """At positions (N, 3) [m]."""
        return _field_of(self).outward_normal(positions)


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatShape(FileShape):
    """The solid behind a splat.

    Parameters
    ----------
    solid
        How it is told from the air.
    """

    kind: ClassVar[str] = "splat"
    solid: SolidOptions = field(default_factory=SolidOptions)

    def resolve(self) -> SignedDistanceField:
        """See `gasp_core.scene.solid_fields`."""
        item = SplatObject(
            name=self.file.name,
            splat=self.file,
            static=True,
            up=self.up,
            height=self.height,
            metres_per_unit=self.metres_per_unit,
            position=self.position,
            rotation=self.rotation,
            solid=self.solid,
        )
        return field_of(place_object(item, read_splat(self.file)).solid(), item.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshShape(FileShape):
    """What the triangles of a mesh enclose.

    Parameters
    ----------
    cells
        Of the grid of distances, along the mesh's longest side.
    thickness
        [m] of the sheet that the triangles are, for meshes that enclose nothing; None: they enclose something.
    """

    kind: ClassVar[str] = "mesh"
    cells: int = 96
    thickness: float | None = None

    def __post_init__(self) -> None:
        FileShape.__post_init__(self)
        whole_number(self, "cells", low=8, high=512)
        if self.thickness is not None:
            positive(self, "thickness")

    def resolve(self) -> SignedDistanceField:
        """See `gasp_core.solid.mesh_distance`."""
        mesh = read_mesh(self.file)
        up = self.up or ("+y" if self.file.suffix.lower() == ".glb" else "+z")
        placement = similarity(
            mesh.vertices[np.unique(mesh.faces)],
            whole_box,
            up=up,
            height=self.height,
            metres_per_unit=self.metres_per_unit,
            rotation=self.rotation,
            position=self.position,
            name=f"mesh {self.file.name}",
        )
        vertices = placement.scale * mesh.vertices @ placement.rotation.T + placement.translation
        return field_of_mesh(vertices, mesh.faces, self.cells, thickness=self.thickness, name=self.file.name)


def _field_of(shape: FileShape) -> SignedDistanceField:
    """The region of a file as it is now."""
    found = file_digest(shape.file)
    if shape.sha256 not in ("", found):
        raise SceneError(
            f"{shown(shape.file)}: is not the file that the collider was made of (its sha256 is {found[:12]}...,"
            f" not {shape.sha256[:12]}...): put that back, or leave sha256 out"
        )
    return _resolved(dataclasses.replace(shape, sha256=found))


@functools.lru_cache(maxsize=16)
def _resolved(shape: FileShape) -> SignedDistanceField:
    """Once for each content: a file that has changed has another."""
    return shape.resolve()


def resolved(collider: Collider) -> Collider:
    """A collider as engines understand it: that of a file as the region which the file describes."""
    if not isinstance(collider.shape, FileShape):
        return collider
    return dataclasses.replace(collider, shape=_field_of(collider.shape))


def known_by_content(collider: Collider) -> Collider:
    """A collider whose file, if it has one, is said by its content too."""
    shape = collider.shape
    if not isinstance(shape, FileShape) or shape.sha256:
        return collider
    return dataclasses.replace(collider, shape=dataclasses.replace(shape, sha256=file_digest(shape.file)))
