"""Parts of an object: which of its Gaussians, and what is theirs alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, cast

from gasp_core.contract import Material, Rigid, Shape
from gasp_core.contract.validation import whole
from gasp_core.errors import SceneError
from gasp_core.scene.columns import Column, column_of
from gasp_core.scene.varying import VaryingMaterial

__all__ = ["Part", "material_of_part"]

_LONGEST_NAME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Some Gaussians of an object, and what is theirs alone. The body stays one: nothing tears where parts meet.

    One of `region`, `component` and `labels` says which Gaussians; `material`, `pinned`, `rigid`
    or `driven`, what of them.

    Parameters
    ----------
    name
        For messages; without one, its number in the object.
    region
        Those whose centre is inside, at the start, in world coordinates.
    component
        Those of a connected piece, 1 the one of most Gaussians; see `gasp_core.scene.floaters.components`.
    labels
        A whole number for each Gaussian of the file, in its order: a path of a ``.npy``, a `PlyProperty`, an array.
    label
        With `labels`: the number, or numbers, of this part.
    material
        None: that of the object.
    pinned
        Its matter stands still.
    rigid
        Its matter moves as a rigid body, of the density that the object has; what deforms around it is welded to it.
    driven
        Its matter goes where the object's motion takes it, whose composition is "driven".

    Raises
    ------
    SceneError
        Where it selects nothing or twice, or says nothing of what it selects.
    """

    name: str = ""
    region: Shape | None = None
    component: int | None = None
    labels: Column | None = None
    label: int | tuple[int, ...] | None = None
    material: Material | VaryingMaterial | None = None
    pinned: bool = False
    rigid: bool = False
    driven: bool = False

    def __post_init__(self) -> None:
        if self.name and (not self.name.isprintable() or len(self.name) > _LONGEST_NAME):
            raise SceneError(f"Part.name must be up to {_LONGEST_NAME} printable characters, found {self.name[:40]!r}")
        if self.labels is not None:
            object.__setattr__(self, "labels", column_of(self.labels))
        if sum(each is not None for each in (self.region, self.component, self.labels)) != 1:
            raise SceneError("Part wants one of region, component and labels, to say which Gaussians it is of")
        if self.component is not None:
            component = whole(self.component)
            if component is None or component < 1:
                raise SceneError(f"Part.component must be a whole number from 1 on, found {self.component!r}")
            object.__setattr__(self, "component", component)
        if (self.labels is None) != (self.label is None):
            raise SceneError("Part.labels and label go together: labels says where they are, label which are meant")
        if self.label is not None:
            given: Any = self.label
            several = isinstance(given, Iterable) and whole(given) is None
            wanted = tuple(whole(each) for each in (cast("Iterable[object]", given) if several else (given,)))
            if not wanted or None in wanted:
                raise SceneError(f"Part.label must be a whole number, or an array of them, found {given!r}")
            object.__setattr__(self, "label", wanted[0] if len(wanted) == 1 else wanted)
        if self.material is None and not (self.pinned or self.rigid or self.driven):
            raise SceneError(
                "Part wants a material, pinned = true, rigid = true or driven = true: it would be as all the rest is"
            )
        if self.rigid and (self.material is not None or self.pinned):
            other = "pinned, which stands still" if self.pinned else 'material (model = "rigid" has a density)'
            raise SceneError(f"Part.rigid contradicts {other}: leave one of them out")
        if self.driven and (self.pinned or self.rigid):
            other = "pinned" if self.pinned else "rigid"
            raise SceneError(f"Part.driven contradicts {other}: leave one of them out")

    def called(self, number: int) -> str:
        """Its name in messages; `number` is its place among the parts, from 0 on."""
        return f'part "{self.name}"' if self.name else f"part {number + 1}"

    @property
    def wanted(self) -> tuple[int, ...]:
        """Its labels."""
        return self.label if isinstance(self.label, tuple) else () if self.label is None else (self.label,)


def material_of_part(part: Part, own: Material | VaryingMaterial) -> Material | VaryingMaterial:
    """What a part is made of, of an object that is made of `own`."""
    if not part.rigid:
        return part.material or own
    if not isinstance(own, VaryingMaterial):
        return Rigid(density=own.density)
    columns = {name: column for name, column in own.columns.items() if name == "density"}
    base = Rigid(density=own.base.density)
    return VaryingMaterial(base=base, columns=columns) if columns else base
