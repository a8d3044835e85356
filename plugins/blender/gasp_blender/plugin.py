"""Registers the engine; imports no backend, so that listing engines stays instant."""

from __future__ import annotations

from collections.abc import Sequence

from gasp_blender.options import BlenderOptions
from gasp_core.contract import (
    BoxShape,
    ContactCondition,
    Determinism,
    Driven,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    EngineEnvironment,
    Field,
    HalfSpace,
    Impulse,
    Pinned,
    Precision,
    Quantity,
    Rigid,
    SignedDistanceField,
    SphereShape,
    Wind,
)
from gasp_core.discovery.hookspecs import hookimpl

__all__ = ["gasp_point_engines"]


@hookimpl
def gasp_point_engines() -> Sequence[EngineDescriptor]:
    """The one engine of this distribution."""
    return [
        EngineDescriptor(
            name="blender",
            summary="Blender's soft bodies on a cage, cloth and rigid bodies: springs, calibrated to Young's modulus",
            contract_version=(1, 4),
            capabilities=EngineCapabilities(
                materials=frozenset({Elastic, Rigid}),
                collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
                region_shapes=frozenset({HalfSpace, BoxShape, SphereShape, SignedDistanceField}),
                contact_conditions=frozenset(ContactCondition),
                drives=frozenset({Pinned, Driven, Impulse}),
                force_fields=frozenset({Wind}),
                output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
                # Not the masses of points, as a node that hardly any matter lies around is made heavier.
                conserved=frozenset({Quantity.ANGULAR_MOMENTUM, Quantity.LINEAR_MOMENTUM}),
                devices=("cpu",),
                precisions=(Precision.FLOAT32,),
                determinism=Determinism.BITWISE,
                temporal_order=1.0,
                checkpoints=True,
                trajectories=True,
            ),
            factory="gasp_blender.engine:Blender",
            options=BlenderOptions,
            environment=EngineEnvironment(python="3.11", packages=("bpy==4.5.15", "numpy<2", "scipy==1.17.1")),
        )
    ]
