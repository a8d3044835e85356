"""A splat as an object of a scene: where it is put, what it is made of, which points stand for it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any, Literal, cast

from gasp_core.contract import BodyContact, Material, Shape
from gasp_core.contract.validation import Vector, finite, finite_vector, instance, member, whole_number
from gasp_core.errors import SceneError
from gasp_core.gaussians import Gaussians
from gasp_core.scene.columns import Column
from gasp_core.scene.motions import DMiSoMotion, FrameSequence, Motion
from gasp_core.scene.parts import Part, material_of_part
from gasp_core.scene.varying import VaryingMaterial, law_of
from gasp_core.solid.options import SolidOptions

__all__ = [
    "Floaters", "Reduction", "SplatObject", "UP_AXES", "UpAxis", "check_rotation", "columns_of", "laws_of",
    "with_columns",
]  # fmt: skip

_LONGEST_NAME = 200

UpAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


UP_AXES: tuple[UpAxis, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")


class Floaters(Enum):
    """What becomes of Gaussians outside the large connected components of an object."""

    DROP = "drop"
    """They are left out of the recording."""
    STILL = "still"
    """They are drawn where they are and never simulated."""
    KEEP = "keep"
    """They are simulated like the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction:
    """Which points an engine is given for an object, and what their motion moves.

    Parameters
    ----------
    mode
        "all": every vertex of every simplex, as in the paper. "cores": the corners of few Gaussians that stand for
        clusters of the object's own. "volume": points that fill the body that the Gaussians are the surface of, eight
        a cell. "centres": the means alone, whose covariances follow the engine's deformation gradient, as PhysGaussian
        has it. "mesh": the vertices of a triangle mesh, whose faces the Gaussians lie on, as GaMeS has it. "auto":
        "volume" where there is such a body, "cores" where it is thin, "all" where Gaussians are few.
    fraction, count
        Cores for each Gaussian of the object that moves, in 0..1, or their number; one of the two, with "cores".
    levels
        Cores of cores: the engine moves the last of so many levels. None with "cores": 1.
    transfer
        "least-squares": a Gaussian follows an affine fit to the cores around it; "frame": the frame of its own core, as
        in the paper; "d-miso": attached to flat triangles, as D-MiSo has it. None with "cores": "least-squares".
    points
        With "volume", "regular", which None means: on a lattice; "jittered": off it by a quarter of their distance.
        With "mesh", "vertices": those alone; "filled": what the mesh encloses too. None: "filled" where it is closed.
    mesh
        File of triangles, in the splat's own frame and unit; with "mesh".
    mesh_up
        The mesh's axis that is up where the splat's is. None: they lie in one frame.

    Raises
    ------
    SceneError
        Where a value is impossible, or has no meaning in this mode.
    """

    mode: str = "auto"
    fraction: float | None = None
    count: int | None = None
    levels: int | None = None
    transfer: Literal["least-squares", "frame", "d-miso"] | None = None
    points: Literal["regular", "jittered", "vertices", "filled"] | None = None
    mesh: Path | None = None
    mesh_up: UpAxis | None = None

    def __post_init__(self) -> None:
        own = {
            "auto": (),
            "all": (),
            "centres": (),
            "volume": ("points",),
            "mesh": ("points", "mesh", "mesh_up"),
            "cores": ("fraction", "count", "levels", "transfer"),
        }
        if self.mode not in own:
            raise SceneError(
                f'Reduction.mode must be "auto", "all", "centres", "cores", "mesh" or "volume", found {self.mode!r}'
            )
        for name in ("fraction", "count", "levels", "transfer", "points", "mesh", "mesh_up"):
            if name not in own[self.mode] and getattr(self, name) is not None:
                raise SceneError(f'Reduction.{name} has no meaning with mode = "{self.mode}": leave it out')
        if self.mode == "volume":
            object.__setattr__(self, "points", self.points or "regular")
            if self.points not in ("regular", "jittered"):
                raise SceneError(f'Reduction.points must be "regular" or "jittered", found {self.points!r}')
        if self.mode == "mesh":
            self._check_mesh()
        if self.mode != "cores":
            return
        if (self.fraction is None) == (self.count is None):
            raise SceneError('Reduction.mode "cores" wants a fraction or a count: give one of them')
        if self.fraction is not None:
            finite(self, "fraction", low=0.0, open_low=True, high=1.0)
        object.__setattr__(self, "levels", 1 if self.levels is None else self.levels)
        if self.count is not None:
            whole_number(self, "count", low=1)
        whole_number(self, "levels", low=1, high=8)
        object.__setattr__(self, "transfer", self.transfer or "least-squares")
        if self.transfer not in ("least-squares", "frame", "d-miso"):
            raise SceneError(
                f'Reduction.transfer must be "least-squares", "frame" or "d-miso", found {self.transfer!r}'
            )
        if self.transfer == "d-miso" and self.levels != 1:
            raise SceneError(f'Reduction.levels must be 1 with transfer = "d-miso", found {self.levels}')

    def _check_mesh(self) -> None:
        if self.mesh is None:
            raise SceneError('Reduction.mesh is missing: mode "mesh" wants a file of triangles')
        object.__setattr__(self, "mesh", Path(self.mesh))
        if self.points not in (None, "vertices", "filled"):
            raise SceneError(f'Reduction.points must be "vertices" or "filled" with a mesh, found {self.points!r}')
        if self.mesh_up not in (None, *UP_AXES):
            raise SceneError(f"Reduction.mesh_up must be one of {', '.join(UP_AXES)}, found {self.mesh_up!r}")

    def with_cores(self, *, fraction: float | None = None, count: int | None = None) -> Reduction:
        """The same with so many cores, levels and transfer as they are; with neither a fraction nor a count: "all"."""
        if fraction is None and count is None:
            return Reduction(mode="all")
        own = self if self.mode == "cores" else Reduction(mode="cores", count=1)
        return replace(own, fraction=fraction, count=count)

    def cores_of(self, gaussians: int) -> int:
        """How many cores so many Gaussians get, at least one."""
        return self.count if self.count is not None else max(1, round((self.fraction or 1.0) * gaussians))


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatObject:
    """A splat, where it is put and what it is made of.

    Parameters
    ----------
    name
        Unique in the scene.
    splat
        A splat file (or folder, for unpacked .sog, of frames, or of a trained D-MiSo), or the Gaussians themselves.
    material
        What it is made of; None only with `static`.
    parts
        What of it is something else, or held: matter that is in none of them is `material`.
    static
        Drawn where it stands, never simulated.
    collider
        How matter collides with the body behind it, only with `static`; None: not at all.
    up
        The splat's axis that becomes +z. None: "-y" for a file, the habit of 3DGS captures, and "+z" for Gaussians
        built in memory, the frame of everything else here.
    height
        Extent along the up axis [m] that the robust bounding box is scaled to.
    metres_per_unit
        Length [m] of the splat's unit instead; 1 where neither is given.
    position
        Where the lower centre of the robust bounding box goes [m], so that an object stands on what is at its z.
        None: the splat's origin stays the world's origin.
    rotation
        Three angles [degrees] about the world's x, then y, then z axis, or a quaternion w x y z; applied to the
        object once it stands upright, before `position`.
    velocity
        Of the object's centre of volume at the start [m/s].
    angular_velocity
        About that centre at the start [rad/s].
    reduction
        Which points the engine is given.
    solid
        How the body that its Gaussians are the surface of is told from the air.
    min_opacity
        Gaussians of a lower opacity (0..1) are left out.
    region
        Part of the world that is simulated; Gaussians whose centre is outside stay still.
    floaters
        What becomes of Gaussians outside the large connected components. "keep" by default: nobody's lettering or
        loose leaves are thrown away unasked; their number is reported all the same.
    vertices
        Vertices of a simplex for this object; None: as in `Scene.maps`.
    motion
        How it moves by itself before physics acts on it; None: not at all.

    Raises
    ------
    SceneError
        Where a value is impossible or two contradict each other.
    """

    name: str
    splat: Path | Gaussians
    material: Material | VaryingMaterial | None = None
    parts: tuple[Part, ...] = ()
    static: bool = False
    collider: BodyContact | None = None
    up: UpAxis | None = None
    height: float | None = None
    metres_per_unit: float | None = None
    position: Vector | None = None
    rotation: tuple[float, ...] | None = None
    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    reduction: Reduction = field(default_factory=Reduction)
    solid: SolidOptions = field(default_factory=SolidOptions)
    min_opacity: float = 0.0
    region: Shape | None = None
    floaters: Floaters = Floaters.KEEP
    vertices: Literal[3, 4, "auto"] | None = None
    motion: Motion | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise SceneError("SplatObject.name must not be empty")
        if not self.name.isprintable() or len(self.name) > _LONGEST_NAME:
            raise SceneError(
                f"SplatObject.name must be up to {_LONGEST_NAME} printable characters, found {self.name[:40]!r}"
            )
        if isinstance(self.splat, str):
            object.__setattr__(self, "splat", Path(self.splat))
        instance(self, "splat", Path, Gaussians)
        # As scene files have it.
        if cast("object", self.collider) is True:
            object.__setattr__(self, "collider", BodyContact())
        instance(self, "collider", BodyContact, type(None))
        instance(self, "reduction", Reduction, hint=', e.g. Reduction(mode="volume")')
        instance(self, "solid", SolidOptions)
        member(self, "floaters", Floaters)
        if self.collider is not None and not self.static:
            raise SceneError(
                f'SplatObject.collider of "{self.name}" has no meaning without static: bodies that move meet anyway'
            )
        if isinstance(self.material, str):
            raise SceneError(
                f'SplatObject.material of "{self.name}" is a name: say gasp_core.material_preset("{self.material}")'
            )
        instance(self, "material", Material, VaryingMaterial, type(None))
        if not self.static and self.material is None:
            raise SceneError(f'SplatObject.material of "{self.name}" is missing: name one, or say static = true')
        object.__setattr__(self, "parts", tuple(self.parts))
        names = [part.name for part in self.parts if part.name]
        for name in names:
            if names.count(name) > 1:
                raise SceneError(f'SplatObject.parts of "{self.name}" has two named "{name}": give each its own name')
        if self.up is not None and self.up not in UP_AXES:
            raise SceneError(f"SplatObject.up must be one of {', '.join(UP_AXES)}, found {self.up!r}")
        if self.height is not None and self.metres_per_unit is not None:
            raise SceneError("SplatObject.height and metres_per_unit contradict each other: give one of them")
        for name in ("height", "metres_per_unit"):
            if getattr(self, name) is not None:
                finite(self, name, low=0.0, open_low=True)
        if self.position is not None:
            finite_vector(self, "position")
        finite_vector(self, "velocity")
        finite_vector(self, "angular_velocity")
        finite(self, "min_opacity", low=0.0, high=1.0)
        if self.rotation is not None:
            check_rotation(self)
        if self.vertices not in (None, 3, 4, "auto"):
            raise SceneError(f'SplatObject.vertices must be 3, 4 or "auto", found {self.vertices!r}')
        if self.static:
            _check_static(self)
        if any(part.driven for part in self.parts) and (self.motion is None or self.motion.composition != "driven"):
            raise SceneError(
                f'SplatObject.parts of "{self.name}": one is driven, and nothing drives it: give the object a motion'
                ' with composition = "driven"'
            )
        if self.reduction.mode == "mesh" and self.region is not None:
            raise SceneError(
                f'SplatObject.region of "{self.name}" has no meaning with reduction.mode = "mesh", which moves as a'
                " whole: leave it out (a part that is pinned holds what is to stay)"
            )
        if self.motion is not None:
            _check_motion(self, self.motion)


def laws_of(item: SplatObject) -> tuple[Material, ...]:
    """What an object and each of its parts are made of, whatever of it varies; nothing where it is static."""
    own = item.material
    return () if own is None else (law_of(own), *(law_of(material_of_part(part, own)) for part in item.parts))


def with_columns(item: SplatObject, change: Callable[[Column], Column]) -> SplatObject:
    """The object with every column of its material and its parts changed, those first."""

    def varied(material: Material | VaryingMaterial | None) -> Material | VaryingMaterial | None:
        if not isinstance(material, VaryingMaterial):
            return material
        return replace(material, columns={name: change(column) for name, column in material.columns.items()})

    own = varied(item.material)
    parts = tuple(
        replace(
            part,
            labels=None if part.labels is None else change(part.labels),
            material=varied(part.material),
        )
        for part in item.parts
    )
    return replace(item, material=own, parts=parts)


def columns_of(item: SplatObject) -> list[Column]:
    """The columns of its material and its parts, in the order of `with_columns`."""
    found: list[Column] = []

    def note(column: Column) -> Column:
        found.append(column)
        return column

    with_columns(item, note)
    return found


def _check_static(owner: SplatObject) -> None:
    """Refuse what says how something is simulated of an object that is not."""
    still = (0.0, 0.0, 0.0)
    said = {
        "material": owner.material is not None,
        "parts": bool(owner.parts),
        "motion": owner.motion is not None,
        "velocity": owner.velocity != still,
        "angular_velocity": owner.angular_velocity != still,
        "reduction": owner.reduction != Reduction(),
        "region": owner.region is not None,
        "vertices": owner.vertices is not None,
    }
    for name, there in said.items():
        if there:
            raise SceneError(
                f'SplatObject.{name} of "{owner.name}" {"have" if name in ("parts", "vertices") else "has"} no meaning'
                " with static: leave one of them out"
            )


def _check_motion(owner: SplatObject, motion: Motion) -> None:
    where = f'SplatObject.motion of "{owner.name}"'
    if motion.composition == "driven" and not any(part.driven for part in owner.parts):
        raise SceneError(f'{where} drives nothing: say driven = true of a part, or another composition than "driven"')
    if isinstance(motion, FrameSequence) and isinstance(owner.splat, Gaussians):
        raise SceneError(f"{where} wants a folder of frames for a splat, found Gaussians in memory")
    if isinstance(motion, DMiSoMotion) and isinstance(owner.splat, Gaussians):
        raise SceneError(f"{where} wants the folder of a trained D-MiSo for a splat, found Gaussians in memory")
    if motion.composition != "frozen" and owner.reduction.mode == "centres":
        raise SceneError(
            f'{where} goes on while physics acts, and reduction.mode "centres" knows no psi of simplices then: say'
            ' composition = "frozen", or another mode'
        )
    if motion.composition == "carried" and owner.reduction.transfer == "d-miso":
        raise SceneError(f'{where} cannot be carried by reduction.transfer "d-miso": say composition = "frozen"')
    if motion.composition == "carried" and (owner.region is not None or owner.floaters is Floaters.STILL):
        key = "region" if owner.region is not None else 'floaters = "still"'
        raise SceneError(
            f"{where} would tear it off what {key} leaves still: leave that out"
            ' (a drive of kind "pinned" holds matter too), or say composition = "frozen"'
        )


def check_rotation(owner: Any) -> None:
    """Replace the field `rotation` by a tuple of three degrees or four parts of a quaternion, or refuse it."""
    value: Any = owner.rotation
    where = f"{type(owner).__name__}.rotation"
    try:
        rotation = tuple(float(component) for component in value)
    except (TypeError, ValueError):
        rotation = ()
    if len(rotation) not in (3, 4) or not all(math.isfinite(component) for component in rotation):
        raise SceneError(f"{where} must be three degrees or a quaternion w x y z, found {value!r}")
    if len(rotation) == 4 and not any(rotation):
        raise SceneError(f"{where} must not be the zero quaternion")
    object.__setattr__(owner, "rotation", rotation)
