"""Sessions as those of every engine for explicit MPM, and what is this one's own."""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.session import MpmSession
from gasp_mpm_host.testing import SessionTests, TracerTests
from gasp_mpm_host.testing.kit import falling, nothing_acts
from gasp_mpm_host.testing.tracers import traced
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud
from gasp_warp_mpm.engine import WarpMpm

from gasp_core.engine.contract import EngineAccuracy, Field, Status
from gasp_core.errors import EngineEnvironmentError, SceneError


class TestSession(SessionTests):
    pass


class TestTracers(TracerTests):
    pass


def test_a_survey_looks_at_what_was_written_alone(kit):
    """Rows of the chart are wider than what is written: memory that held anything before must not stop a run."""
    with kit.open(falling(kit), spacing=0.1) as session:
        cloud = session._cloud
        cloud.survey()
        written = cloud._chart.numpy().reshape(-1, at.SURVEY_WIDTH)
        assert (written[:, at.SURVEY_HIGH + 3 :] == 0).all()
        assert cloud.survey().finite


def test_a_gpu_that_is_not_there_is_said_so(kit):
    wp.init()
    if wp.is_cuda_available():
        pytest.skip("this machine has a CUDA GPU")
    with pytest.raises(EngineEnvironmentError, match="cuda"):
        WarpMpm().open(falling(kit), device="cuda")
    with pytest.raises(SceneError, match="no device"):
        WarpMpm().open(falling(kit), device="tpu")


@pytest.mark.parametrize("material", ["elastic", "rubber"])
def test_the_way_of_the_gpu_gives_the_same_motion(kit, material):
    """Its arrays and its scatter with atomics, run on the CPU: the order of additions apart, the same arithmetic."""
    problem = traced(falling(kit, material))
    with kit.open(problem, precision="float64", spacing=0.1) as session:
        assert session.advance_to(0.05).status is Status.OK
        expected = session.read(frozenset(Field))
    build = partial(Cloud, device=runtime.device_for("cpu"), double=True, threads=1, atomic=True, native=False)
    accuracy = EngineAccuracy(spacing=0.1)
    with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=build) as session:
        assert session.advance_to(0.05).status is Status.OK
        found = session.read(frozenset(Field))
        kept = session.checkpoint()
    # Some tens of steps of rounding in another order.
    assert np.abs(found.positions - expected.positions).max() <= 1e-12
    assert np.abs(found.tracer_positions - expected.tracer_positions)[:-3].max() <= 1e-12
    assert np.array_equal(kept["rows"].shape, (512, at.POINT_WIDTH))


def test_an_unsolicited_word_is_never_printed():
    code = "from gasp_warp_mpm import runtime; runtime.device_for('cpu')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (result.stdout, result.stderr) == ("", "")


def test_plugin_imports_no_backend():
    code = "import sys, gasp_warp_mpm.plugin as p; p.gasp_point_engines(); sys.exit('warp' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_way_of_the_gpu_stops_after_the_step_in_which_a_point_drifted(kit):
    """Though the host looks only when the whole batch has been launched."""
    problem = falling(kit, colliders=(), gravity=(0, 0, 0))
    build = partial(Cloud, device=runtime.device_for("cpu"), double=True, threads=1, atomic=True, native=False)
    with MpmSession(problem, engine="warp-mpm", accuracy=EngineAccuracy(spacing=0.02), build=build) as session:
        cloud = session._cloud
        start = cloud.positions()
        cloud.begin_batch(0.75 * 0.02 / 2.0, np.zeros(3), *nothing_acts(20))
        done, drifted, _ = cloud.steps(0, 20)
        assert drifted
        # Three quarters of a cell a step, from anywhere in a cell, and a cell of slack.
        assert done in (1, 2)
        # Undeformed points fly on as they are.
        travel = np.linalg.norm(cloud.positions() - start, axis=1)
        assert np.abs(travel - done * 0.75 * 0.01 * np.hypot(0.3, 2.0)).max() <= 1e-9
