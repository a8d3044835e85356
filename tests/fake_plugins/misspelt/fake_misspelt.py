"""An engine behind a misspelt hook"""

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
def gasp_point_engine():
    return [
        EngineDescriptor(
            name="misspelt",
            summary="An engine behind a misspelt hook",
            contract_version=(1, 0),
            capabilities=CAPABILITIES,
            factory="fake_misspelt:Nothing",
        )
    ]
