"""The state of every engine that is installed, told without importing any engine's own code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gasp_core.contract import EngineCapabilities, EngineDescriptor
from gasp_core.discovery.environments import environment_fault, folder_of, state_of
from gasp_core.discovery.loading import how_to_mend
from gasp_core.discovery.registry import EngineOffer, Registry
from gasp_core.discovery.requirements import missing_factory, missing_requirements, source_fault

__all__ = ["EngineRow", "engine_rows"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineRow:
    """One engine, or one plugin that failed.

    Parameters
    ----------
    name
        Of the engine; of the plugin where it failed as a whole.
    status
        "ready", "missing backend" (a package it needs is not installed), "not installed" or "outdated" (its own
        environment), "duplicate" (its name is offered twice) or "failed".
    distribution
        That brings it.
    descriptor
        None for a plugin that failed.
    error
        What is wrong and what to do, one line; None where nothing is.
    """

    name: str
    status: str
    distribution: str
    descriptor: EngineDescriptor | None
    error: str | None

    def to_json(self) -> dict[str, Any]:
        """Plain values; capabilities as sorted lists of the words a scene file uses."""
        row: dict[str, Any] = {
            "name": self.name,
            "status": self.status,
            "error": self.error,
            "distribution": self.distribution,
        }
        if self.descriptor is not None:
            row |= {
                "summary": self.descriptor.summary,
                "contract_version": list(self.descriptor.contract_version),
                "options": list(self.descriptor.option_names()),
                "environment": _environment(self.descriptor),
                **_capabilities(self.descriptor.capabilities),
            }
        return row


def engine_rows(registry: Registry) -> list[EngineRow]:
    """All engines of a registry by name, then the plugins that failed."""
    rows = [_row(registry, name, offer) for name, offers in registry.offers.items() for offer in offers]
    rows += [
        EngineRow(
            name=failure.name,
            status="failed",
            distribution=failure.distribution,
            descriptor=None,
            error=failure.error,
        )
        for failure in registry.failures
    ]
    return rows


def _row(registry: Registry, name: str, offer: EngineOffer) -> EngineRow:
    status, error = "ready", None
    absent = missing_factory(offer.descriptor.factory)
    # Another interpreter than this one may read its source otherwise.
    unreadable = source_fault(offer.descriptor.factory) if offer.descriptor.environment is None else None
    missing = missing_requirements(offer.distribution)
    if len(registry.offers[name]) > 1:
        status, error = "duplicate", registry.duplicate(name)
    elif absent is not None:
        status = "failed"
        error = f"its module {absent} is not there; {how_to_mend(offer.distribution)}"
    elif unreadable is not None:
        status = "failed"
        error = f"{unreadable}; {how_to_mend(offer.distribution)}"
    elif missing:
        status = "missing backend"
        error = f"needs {', '.join(missing)}, which is not installed: {how_to_mend(offer.distribution)}"
    elif offer.descriptor.environment is not None:
        status, error = state_of(offer.descriptor).value, environment_fault(offer.descriptor)
    return EngineRow(
        name=name, status=status, distribution=offer.distribution, descriptor=offer.descriptor, error=error
    )


def _environment(descriptor: EngineDescriptor) -> dict[str, Any] | None:
    own = descriptor.environment
    if own is None:
        return None
    return {"python": own.python, "packages": list(own.packages), "folder": str(folder_of(descriptor))}


def _capabilities(can: EngineCapabilities) -> dict[str, Any]:
    return {
        "materials": sorted(material.kind for material in can.materials),
        "collider_shapes": sorted(_kind(shape) for shape in can.collider_shapes),
        "contact_conditions": sorted(contact.value for contact in can.contact_conditions),
        "body_contacts": sorted(contact.value for contact in can.body_contacts),
        "bodies_meet": can.bodies_meet,
        "pair_contacts": can.pair_contacts,
        "moving_colliders": can.moving_colliders,
        "restitution": can.restitution,
        "rigid_parts": can.rigid_parts,
        "material_damping": can.material_damping,
        "cohesion": can.cohesion,
        "drives": sorted(drive.kind for drive in can.drives),
        "force_fields": sorted(force.kind for force in can.force_fields),
        "output_fields": sorted(field.value for field in can.output_fields),
        "conserved": sorted(quantity.value for quantity in can.conserved),
        "devices": list(can.devices),
        "precisions": [precision.value for precision in can.precisions],
        "determinism": can.determinism.value,
        "domain_policies": sorted(policy.value for policy in can.domain_policies),
        "temporal_order": can.temporal_order,
        "iterates": can.iterates,
        "carries_tracers": can.carries_tracers,
        "checkpoints": can.checkpoints,
    }


def _kind(shape: type) -> str:
    return str(getattr(shape, "kind", shape.__name__))
