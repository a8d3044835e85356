"""An engine whose module is not there"""

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
            name="no-factory",
            summary="An engine whose module is not there",
            contract_version=(1, 0),
            capabilities=CAPABILITIES,
            factory="fake_no_factory_engine:Engine",
        )
    ]
