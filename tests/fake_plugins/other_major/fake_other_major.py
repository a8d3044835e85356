"""An engine of another contract"""

from gasp_core.contract import Determinism, Elastic, EngineCapabilities, EngineDescriptor, Field, Precision
from gasp_core.discovery.hookspecs import hookimpl

CAPABILITIES = EngineCapabilities(
    materials=frozenset({Elastic}),
    collider_shapes=frozenset(),
    contact_conditions=frozenset(),
    drives=frozenset(),
    force_fields=frozenset(),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    conserved=frozenset(),
    devices=("cpu",),
    precisions=(Precision.FLOAT64,),
    determinism=Determinism.BITWISE,
)


@hookimpl
def gasp_point_engines():
    return [
        EngineDescriptor(
            name="other-major",
            summary="An engine of another contract",
            contract_version=(2, 0),
            capabilities=CAPABILITIES,
            factory="fake_other_major:Nothing",
        )
    ]
