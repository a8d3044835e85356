"""What only this engine promises; what every engine has to do is the suite's, `gasp-conformance my-engine --quick`."""

import numpy as np
from my_engine.engine import Engine

from gasp_core.contract import EngineAccuracy, Field, PointCloud, PointProblem, Precision, Rigid


def test_a_thrown_body_flies_along_a_parabola_and_keeps_its_shape():
    corners = np.array([[x, y, z] for x in (0.0, 0.3) for y in (0.0, 0.2) for z in (0.0, 0.1)])
    thrown = np.array([1.0, -2.0, 3.0])
    points = PointCloud(
        reference_positions=corners,
        initial_velocities=thrown + np.cross([2.0, 5.0, -1.0], corners - corners.mean(axis=0)),
        reference_volumes=np.full(8, 1e-3),
        material_ids=np.zeros(8),
        body_ids=np.zeros(8),
    )
    problem = PointProblem(points=points, materials=(Rigid(density=500.0),))
    accuracy = EngineAccuracy()
    with Engine().open(problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=accuracy) as session:
        session.advance_to(1.0)
        positions = session.read(frozenset({Field.POSITIONS})).positions

    center = corners.mean(axis=0) + thrown + np.array(problem.gravity) / 2
    # A metre or two, and some tens of steps: rounding is far below.
    np.testing.assert_allclose(positions.mean(axis=0), center, atol=1e-12)
    before = np.linalg.norm(corners - corners[0], axis=1)
    np.testing.assert_allclose(np.linalg.norm(positions - positions[0], axis=1), before, atol=1e-12)
