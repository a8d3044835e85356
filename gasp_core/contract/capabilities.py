"""The one comparison of a scene with what an engine declares; what is not declared is refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gasp_core.contract.descriptor import EngineCapabilities, EngineDescriptor
from gasp_core.contract.fields import Field, Precision
from gasp_core.contract.forcing import DEFAULT_BODY_CONTACT
from gasp_core.contract.materials import Elastic, Material, NeoHookean, Rigid, Sand
from gasp_core.contract.points import PointProblem
from gasp_core.contract.shapes import Shape
from gasp_core.errors import UnsupportedSceneError

__all__ = ["Need", "check_supported", "needs", "unmet"]


@dataclass(frozen=True, slots=True)
class Need:
    """One thing a scene asks of an engine.

    Parameters
    ----------
    refusal
        What to say behind the name of an engine that cannot do it, e.g. 'does not model sand (object "bucket")'.
    capability
        The field of `EngineCapabilities` that would declare it.
    item
        What that field has to contain; without meaning where the field is yes or no.
    """

    refusal: str
    capability: str
    item: object = None

    def met_by(self, capabilities: EngineCapabilities) -> bool:
        """Whether an engine with these capabilities can do it."""
        declared: Any = getattr(capabilities, self.capability)
        if self.capability == "devices":
            return capabilities.runs_on(str(self.item))
        return declared if isinstance(declared, bool) else self.item in declared


def needs(
    problem: PointProblem,
    *,
    device: str | None = None,
    precision: Precision | None = None,
    fields: frozenset[Field] = frozenset(),
    checkpoints: bool = False,
    body_names: Sequence[str] = (),
    drive_names: Sequence[str] = (),
) -> list[Need]:
    """Everything a scene asks of an engine, most telling first; the parameters are those of `check_supported`."""
    materials = list(zip(problem.materials, _material_users(problem, body_names)))
    asked = [
        Need(f"does not model {material.kind}{_as_named(material)}{users}", "materials", type(material))
        for material, users in materials
        if users is not None
    ]
    asked += [
        Need(f"has no restitution of rigid bodies{users}", "restitution")
        for material, users in materials
        if users is not None and isinstance(material, Rigid) and material.restitution > 0
    ]
    asked += [
        Need(f"damps no {material.kind}{users}", "material_damping")
        for material, users in materials
        if users is not None
        and isinstance(material, Elastic | NeoHookean)
        and (material.mass_damping > 0 or material.stiffness_damping > 0)
    ]
    asked += [
        Need(f"has no cohesion of {material.kind}{users}", "cohesion")
        for material, users in materials
        if users is not None and isinstance(material, Sand) and material.cohesion > 0
    ]
    for number, collider in enumerate(problem.colliders, start=1):
        shape, contact = collider.shape, collider.contact
        asked += [
            Need(f"knows no {shape.kind} as a collider (collider {number})", "collider_shapes", type(shape)),
            Need(f'knows no contact "{contact.value}" (collider {number})', "contact_conditions", contact),
        ]
        if collider.motion is not None:
            asked.append(Need(f"knows no colliders that move (collider {number})", "moving_colliders"))
    for number, drive in enumerate(problem.drives, start=1):
        where = drive_names[number - 1] if number <= len(drive_names) else f"drive {number}"
        asked.append(Need(f'knows no drive "{drive.kind}" ({where})', "drives", type(drive)))
        asked.append(_region_need(drive.region, where))
    for number, force in enumerate(problem.force_fields, start=1):
        asked.append(Need(f'knows no force field "{force.kind}" (force field {number})', "force_fields", type(force)))
        if force.region is not None:
            asked.append(_region_need(force.region, f"force field {number}"))
    asked += _contact_needs(problem, body_names)
    whose = dict.fromkeys(_called(host, body_names) for host in problem.rigid_parts.values())
    if whose:
        asked.append(Need(f"has no rigid parts of bodies that deform ({', '.join(whose)})", "rigid_parts"))
    if problem.trajectories is not None:
        asked.append(Need("leads no points along trajectories", "trajectories"))
    if problem.domain is not None:
        policy = problem.domain.policy
        asked.append(Need(f'knows no domain policy "{policy.value}"', "domain_policies", policy))
    if problem.points.tracer_positions is not None:
        asked.append(Need("carries no tracers", "carries_tracers"))
    for name in sorted(problem.points.material_columns):
        asked.append(Need(f"has no {name} that varies from point to point", "material_columns", name))
    # Positions are never optional, so an engine need not declare them.
    for field in sorted(fields - {Field.POSITIONS}, key=lambda field: field.value):
        asked.append(Need(f"cannot report {field.value}", "output_fields", field))
    if checkpoints:
        asked.append(Need("writes no checkpoints, so a run cannot go on from one", "checkpoints"))
    if device is not None:
        asked.append(Need(f'does not run on device "{device}"', "devices", device))
    if precision is not None:
        asked.append(Need(f"does not compute in {precision.value}", "precisions", precision))
    return asked


def _contact_needs(problem: PointProblem, body_names: Sequence[str]) -> list[Need]:
    """Of how bodies meet. Of one body, or where nothing else than the default is said, there are none."""
    asked: list[Need] = []
    default = problem.body_contact
    if default != DEFAULT_BODY_CONTACT and problem.points.body_ids.any():
        asked.append(Need(f'knows no contact "{default.contact.value}" of bodies', "body_contacts", default.contact))
    for (low, high), contact in problem.pair_contacts.items():
        names = [_called(body, body_names) for body in (low, high)]
        where = f"{names[0]} and {names[1]}"
        asked.append(Need(f'knows no contact "{contact.contact.value}" of {where}', "body_contacts", contact.contact))
        if contact != default:
            asked.append(Need(f"has one contact for all bodies, none of {where} alone", "pair_contacts"))
    return asked


def _called(body: int, names: Sequence[str]) -> str:
    return f'"{names[body]}"' if body < len(names) else f"body {body}"


def _region_need(region: Shape, where: str) -> Need:
    return Need(f"knows no {region.kind} as a region ({where})", "region_shapes", type(region))


def unmet(asked: Iterable[Need], capabilities: EngineCapabilities) -> list[Need]:
    """Those that an engine with these capabilities cannot meet."""
    return [need for need in asked if not need.met_by(capabilities)]


def check_supported(
    problem: PointProblem,
    descriptor: EngineDescriptor,
    *,
    device: str | None = None,
    precision: Precision | None = None,
    fields: frozenset[Field] = frozenset(),
    checkpoints: bool = False,
    body_names: Sequence[str] = (),
    drive_names: Sequence[str] = (),
    others: Iterable[EngineDescriptor] = (),
) -> None:
    """Refuse a scene that needs what the engine does not declare.

    Parameters
    ----------
    problem
        The scene as the engine would get it.
    descriptor
        The engine.
    device, precision
        As asked for; None is the engine's own first choice.
    fields
        What will be read besides positions.
    checkpoints
        Whether the run is to go on from a checkpoint.
    body_names
        Names of the bodies 0, 1, 2, ... for the message.
    drive_names
        Of the drives, likewise; "drive 1", "drive 2", ... where there are none.
    others
        All installed engines: those that could do what this one cannot are named.

    Raises
    ------
    UnsupportedSceneError
        In one line: what this engine cannot do, and which engines can.
    """
    asked = needs(
        problem,
        device=device,
        precision=precision,
        fields=fields,
        checkpoints=checkpoints,
        body_names=body_names,
        drive_names=drive_names,
    )
    missing = unmet(asked, descriptor.capabilities)
    if not missing:
        return
    refusals = dict.fromkeys(need.refusal for need in missing)
    able = sorted(
        {other.name for other in others if other.name != descriptor.name and not unmet(missing, other.capabilities)}
    )
    own = _choices(missing, descriptor)
    others_do = f"engines that do: {', '.join(able)}" if able else "" if own else "no other installed engine does"
    raise UnsupportedSceneError(
        "; ".join([f"{descriptor.name} {' and '.join(refusals)}", *filter(None, (own, others_do))])
    )


def _as_named(material: Material) -> str:
    """What a material is called, where it has a name of its own."""
    return f', the model of "{material.name}"' if material.name else ""


def _material_users(problem: PointProblem, body_names: Sequence[str]) -> list[str | None]:
    """For each material, ' (object "name")' of its first bodies, '' where these have no name, None if unused."""
    points = problem.points
    pairs = np.unique(np.stack([points.material_ids, points.body_ids], axis=1), axis=0)
    users: list[str | None] = []
    for row in range(len(problem.materials)):
        bodies = [int(body) for body in pairs[pairs[:, 0] == row, 1]]
        named = list(dict.fromkeys(f'"{body_names[body]}"' for body in bodies if 0 <= body < len(body_names)))
        if not bodies:
            users.append(None)
        elif not named:
            users.append("")
        else:
            more = f" and {len(named) - 3} more" if len(named) > 3 else ""
            users.append(f" (object {', '.join(named[:3])}{more})")
    return users


def _choices(missing: Sequence[Need], descriptor: EngineDescriptor) -> str:
    """What the engine itself offers where only device or precision is the trouble."""
    lacking = {need.capability for need in missing}
    can = descriptor.capabilities
    if lacking == {"devices"}:
        return f"choose device {' or '.join(can.devices)}"
    if lacking == {"precisions"}:
        return f"choose precision {' or '.join(precision.value for precision in can.precisions)}"
    return ""
