"""Before runs of pytest within a test: these forget the modules that they were the first to import.

Numba's cannot be imported twice, and most of them come only when something is compiled or comes out of its cache.
"""

import numpy as np
import pytest
from gasp_conformance.clouds import box_of_points, cloud_of

from gasp_core.contract import Collider, Elastic, EngineAccuracy, HalfSpace, PointProblem, Precision, Rigid
from gasp_core.discovery.registry import discover
from gasp_core.engines.opening import open_engine


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """All that the right engine has compiled: a rigid block on another one and on a soft one, for some steps."""
    spacing = 0.1
    blocks = [box_of_points((0.0, 0.0, 0.2 * row), (2, 2, 2), spacing) for row in range(3)]
    soft = Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3)
    problem = PointProblem(
        points=cloud_of(blocks, [np.zeros(3)] * 3, spacing, range(3)),
        materials=(soft, Rigid(density=500.0), Rigid(density=500.0)),
        colliders=(Collider(shape=HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))),),
    )
    engine = open_engine(discover().offer("reference-mpm"))
    accuracy = EngineAccuracy(spacing=spacing)
    with engine.open(problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=accuracy) as session:
        session.advance_to(0.01)
