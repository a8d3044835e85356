"""What an author may have got wrong in what an engine declares, before anything looks into it."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from enum import Enum
from typing import Any

from gasp_core.contract import (
    ContactCondition,
    Determinism,
    DomainPolicy,
    Drive,
    EngineCapabilities,
    Field,
    ForceField,
    Material,
    Precision,
    Quantity,
)

__all__ = ["capability_fault"]

_MEMBERS: dict[str, type[Enum]] = {
    "contact_conditions": ContactCondition,
    "body_contacts": ContactCondition,
    "output_fields": Field,
    "views": Field,
    "conserved": Quantity,
    "domain_policies": DomainPolicy,
}
_CLASSES: dict[str, type | None] = {
    "materials": Material,
    "drives": Drive,
    "force_fields": ForceField,
    "collider_shapes": None,
    "region_shapes": None,
}
_FLAGS = (
    "iterates", "carries_tracers", "checkpoints", "bodies_meet", "pair_contacts", "moving_colliders", "restitution",
    "rigid_parts",
    "material_damping", "cohesion", "trajectories", "device_indices", "unconditionally_stable",
)  # fmt: skip


def capability_fault(can: EngineCapabilities) -> str | None:
    """The first field whose value is not what the contract says, in one line; None where all are."""
    for name, kind in _MEMBERS.items():
        if fault := _set_fault(can, name, f"of {kind.__name__}, e.g. {next(iter(kind))}", kind=kind):
            return fault
    for name, base in _CLASSES.items():
        what = "of classes of shapes, e.g. HalfSpace" if base is None else f"of classes of {base.__name__}"
        if fault := _set_fault(can, name, what, base=base or object):
            return fault
    if fault := _set_fault(can, "material_columns", "of texts", kind=str):
        return fault
    for name, kind, example in (("devices", str, '("cpu",)'), ("precisions", Precision, "(Precision.FLOAT32,)")):
        values: Any = getattr(can, name)
        if not isinstance(values, tuple) or not values or not all(isinstance(one, kind) for one in values):
            return f"capabilities.{name} must be a tuple like {example}, found {values!r:.60}"
    if not isinstance(_value(can, "determinism"), Determinism):
        return f"capabilities.determinism must be a Determinism, found {can.determinism!r:.60}"
    for name in _FLAGS:
        if not isinstance(_value(can, name), bool):
            return f"capabilities.{name} must be True or False, found {_value(can, name)!r:.60}"
    if not can.bodies_meet and (can.body_contacts or can.pair_contacts):
        return "capabilities.bodies_meet is False, and body_contacts or pair_contacts say how they do: leave one out"
    if can.stable_step is not None and not callable(_value(can, "stable_step")):
        return f"capabilities.stable_step must be a function or None, found {can.stable_step!r:.60}"
    return None


def _value(can: EngineCapabilities, name: str) -> object:
    # A plugin's fields hold whatever its author wrote, whatever their annotations say.
    return getattr(can, name)


def _set_fault(
    can: EngineCapabilities, name: str, what: str, *, kind: type | None = None, base: type | None = None
) -> str | None:
    values: Any = getattr(can, name)
    if not isinstance(values, AbstractSet):
        return f"capabilities.{name} must be a frozenset {what}, found {values!r:.60}"
    for one in values:  # pyright: ignore[reportUnknownVariableType]
        fits = isinstance(one, kind) if kind is not None else isinstance(one, type) and issubclass(one, base or object)
        if not fits:
            return f"capabilities.{name} must be a frozenset {what}, found {one!r:.60} in it"
    return None
