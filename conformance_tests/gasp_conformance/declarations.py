"""The checks that have to pass for an engine's declarations to be believed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gasp_conformance.checks import Level
from gasp_conformance.report import CheckResult, Outcome, Unproven
from gasp_core.contract import EngineCapabilities, Field, Precision

__all__ = ["ABSENT", "base_name", "declared", "unproven"]

ABSENT = "not on this machine"
"""How the reason of a skipped check begins where a device is wanted that is not there."""


def base_name(name: str) -> str:
    """Name of a check without the ids of its parameters: "V8" of "V8[4 cells]"."""
    return name.partition("[")[0]


def declared(capabilities: EngineCapabilities, precision: Precision) -> list[str]:
    """Names of the checks that show what an engine declares, when it is run in `precision`.

    Positions and the run's own precision are left out: no check passes without them.
    """
    can = capabilities
    kinds: list[tuple[str, Iterable[object]]] = [
        ("material", can.materials),
        ("collider", can.collider_shapes),
        ("walls", can.contact_conditions),
        ("bodies", can.body_contacts),
        ("drive", can.drives),
        ("force-field", can.force_fields),
        ("field", (field for field in can.output_fields if field is not Field.POSITIONS)),
        ("conserved", can.conserved),
        ("device", can.devices),
        ("precision", (one for one in can.precisions if one is not precision)),
        ("domain", can.domain_policies),
        ("view", can.views),
        ("material-column", can.material_columns),
    ]
    names = [f"{kind}:{word}" for kind, items in kinds for word in sorted(_word(item) for item in items)]
    flags = {
        "pair-contacts": can.pair_contacts,
        "moving-colliders": can.moving_colliders,
        "restitution": can.restitution,
        "rigid-parts": can.rigid_parts,
        "material-damping": can.material_damping,
        "cohesion": can.cohesion,
        "trajectories": can.trajectories,
        "checkpoints": can.checkpoints,
        "tracers": can.carries_tracers,
        "device-indices": can.device_indices,
    }
    return names + [name for name, has in flags.items() if has]


def unproven(names: Iterable[str], results: Sequence[CheckResult], left_out: Iterable[str]) -> tuple[Unproven, ...]:
    """Those of the declared `names` that no check shows.

    Parameters
    ----------
    results
        What ran.
    left_out
        Names of checks that a quick run leaves to a full one.
    """
    later = {base_name(name) for name in left_out}
    found: list[Unproven] = []
    for name in names:
        own = [result for result in results if base_name(result.name) == name and result.level is Level.CAPABILITY]
        if any(result.outcome is Outcome.PASSED for result in own):
            continue
        if own:
            first = own[0]
            absent = first.outcome is Outcome.SKIPPED and first.reason.startswith(ABSENT)
            reason = first.reason if absent else f"its check {_ENDED[first.outcome]}"
            found.append(Unproven(capability=name, reason=reason, excused=absent and name.startswith("device:")))
        elif name in later:
            found.append(Unproven(capability=name, reason="left to a full run", excused=True))
        else:
            found.append(Unproven(capability=name, reason="no check shows it", excused=False))
    return tuple(found)


def _word(item: object) -> str:
    """As scene files have it: the kind of a class, the value of a choice, a name as it is."""
    return str(getattr(item, "kind", getattr(item, "value", item)))


_ENDED = {
    Outcome.FAILED: "failed",
    Outcome.DEVIATES: "deviates",
    Outcome.STALE: "is a stale deviation",
    Outcome.UNDECLARED: "needs what is not declared",
    Outcome.SKIPPED: "was skipped",
    Outcome.ERROR: "ended in an error",
}
