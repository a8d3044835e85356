"""The loops in native code against the readable ones beside them: the same sums in another order."""

from functools import partial

import numpy as np
import pytest
from gasp_mpm_host.session import MpmSession
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud

from gasp_core.engine.contract import EngineAccuracy, Status
from gasp_core.engine.forcing import Collider
from gasp_core.engine.shapes import HalfSpace

SIDE = 0.4
STEP = 2e-4
STEPS = 200
# The sums have some 30 terms. float64: 30 roundings of 1.1e-16 of 2 m/s, in the same direction in all of 200 steps, are
# 1.3e-12 m/s and, in 0.04 s, 5e-14 m = 1.3e-13 of the side; stress has the speed of sound for its unit, 8 times more.
# float32: 200 half ulps of 2 m/s in the same direction are 2.4e-6 of the side; the bar against the reference engine.
TOLERANCE = {"float64": 1e-12, "float32": 1e-5}


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("kinds", [("elastic",), ("rubber",), ("sand", "elastic", "fluid")], ids="+".join)
def test_native_and_readable_bodies_agree(kit, kinds, precision):
    blocks = [kit.block(SIDE, corner=(0, 0, 0.05 + 0.42 * index), seed=index) for index in range(len(kinds))]
    positions = np.concatenate(blocks)
    problem = kit.problem(
        positions,
        tuple(kit.materials[kind] for kind in kinds),
        ids=np.repeat(np.arange(len(kinds)), len(blocks[0])),
        volumes=np.full(len(positions), SIDE**3 / len(blocks[0])),
        velocity=np.array([0.5, 0.0, -2.0]) + np.random.default_rng(1).normal(scale=0.1, size=positions.shape),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),),
    )
    found = []
    for native in (False, True):
        build = partial(
            Cloud,
            device=runtime.device_for("cpu"),
            double=precision == "float64",
            threads=1,
            atomic=False,
            native=native,
        )
        accuracy = EngineAccuracy(spacing=0.1, substep=STEP)
        with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=build) as session:
            assert session.advance_to(STEP * STEPS).status is Status.OK
            found.append(session.read(kit.everything))
    assert np.abs(found[0].positions - found[1].positions).max() / SIDE <= TOLERANCE[precision]
    assert np.abs(found[1].positions - positions).max() > 0.05 * SIDE  # something happened
    if precision == "float64":
        assert np.abs(found[0].velocities - found[1].velocities).max() <= 1e-10
