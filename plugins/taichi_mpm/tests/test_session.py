"""Sessions as those of every engine for explicit MPM, and what is this one's own."""

import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from gasp_mpm_host.session import MpmSession, opened
from gasp_mpm_host.testing import CheckpointTests, SessionTests, TracerTests
from gasp_mpm_host.testing.agreement import COMPANIES
from gasp_mpm_host.testing.kit import falling
from gasp_mpm_host.testing.tracers import go_alike, traced
from gasp_taichi_mpm import runtime
from gasp_taichi_mpm.cloud import Cloud
from gasp_taichi_mpm.engine import TaichiMpm

from gasp_core.contract import EngineAccuracy, Field, Rigid
from gasp_core.errors import EngineEnvironmentError, SceneError


class TestSession(SessionTests):
    pass


class TestCheckpoints(CheckpointTests):
    pass


class TestTracers(TracerTests):
    pass


def test_a_gpu_that_is_not_there_is_said_so(kit):
    if runtime.taichi.lang.misc.is_arch_supported(runtime.taichi.cuda):
        pytest.skip("this machine has a CUDA GPU")
    with pytest.raises(EngineEnvironmentError, match="cuda"):
        TaichiMpm().open(falling(kit), device="cuda")
    with kit.open(falling(kit), spacing=0.1), pytest.raises(SceneError, match="close it"):
        TaichiMpm().open(falling(kit), device="cuda")
    with pytest.raises(SceneError, match="no device"):
        TaichiMpm().open(falling(kit), device="tpu")


def test_rigid_bodies_alone_do_not_count_as_a_session(kit):
    """They have no cloud in Taichi, so nothing would count them out when they are closed."""
    with kit.open(replace(falling(kit), materials=(Rigid(density=1000.0),)), spacing=0.1) as session:
        session.advance_to(0.01)
        assert runtime._open_sessions == 0


@pytest.mark.parametrize("material", ["elastic", pytest.param("rubber", marks=pytest.mark.thorough)])
def test_the_way_of_the_gpu_gives_the_same_motion(kit, material):
    """Its arrays and its scatter with atomics, run on the CPU: the order of additions apart, the same arithmetic."""
    problem = traced(falling(kit, material))
    with kit.open(problem, precision="float64", spacing=0.1) as session:
        session.advance_to(0.05)
        expected = session.read(frozenset(Field))
    runtime.acquire("cpu")
    accuracy = EngineAccuracy(spacing=0.1)
    build = partial(Cloud, double=True, threads=1, on_gpu=True)
    with MpmSession(problem, engine="taichi-mpm", accuracy=accuracy, build=build) as session:
        session.advance_to(0.05)
        found = session.read(frozenset(Field))
        kept = session.checkpoint()
    # Some tens of steps of rounding in another order.
    assert np.abs(found.positions - expected.positions).max() <= 1e-12
    assert np.abs(found.tracer_positions - expected.tracer_positions)[:-3].max() <= 1e-12
    assert np.array_equal(kept["rows"].shape, (512, 32))


@pytest.mark.parametrize("company", ["one that is led", pytest.param("rigid and soft", marks=pytest.mark.thorough)])
def test_the_way_of_the_gpu_has_tracers_go_with_what_is_rigid_or_led(kit, company):
    """Its steps in parts, of which the one that writes what tracers read moves none."""
    problem, accuracy = traced(COMPANIES[company]()), EngineAccuracy(spacing=0.05, substep=5e-4)

    def sessions():
        yield kit.open(problem, precision="float64", spacing=0.05, substep=5e-4)
        runtime.acquire("cpu")
        build = partial(Cloud, double=True, on_gpu=True)
        yield opened(problem, engine="taichi-mpm", accuracy=accuracy, build=build)

    go_alike(problem, sessions())


_INTERRUPTED = """
import sys
import numpy as np
from gasp_core.contract import EngineAccuracy, Field, PointCloud, PointProblem
from gasp_core.contract import Elastic
from gasp_core.errors import EngineEnvironmentError
from gasp_taichi_mpm import runtime
from gasp_taichi_mpm.engine import TaichiMpm

places = np.random.default_rng(0).uniform(0, 0.4, (50, 3))
cloud = PointCloud(
    reference_positions=places,
    initial_velocities=np.zeros_like(places),
    reference_volumes=np.full(50, 1e-3),
    material_ids=np.zeros(50, dtype=int),
    body_ids=np.zeros(50, dtype=int),
)
problem = PointProblem(points=cloud, materials=(Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3),))
accuracy = EngineAccuracy(spacing=0.1)
session = TaichiMpm().open(problem, accuracy=accuracy)
session.advance_to(0.001)
kept = session.checkpoint()
ti = runtime.taichi
if sys.argv[1] == "init":
    ti.init(arch=ti.cpu, log_level=ti.ERROR)
else:
    ti.reset()
everything = frozenset({Field.POSITIONS})
for use in (lambda: session.advance_to(0.002), lambda: session.read(everything), session.checkpoint):
    try:
        use()
    except EngineEnvironmentError as error:
        assert "ti.init" in str(error)
    else:
        sys.exit("a session outlived its runtime")
session.close()
with TaichiMpm().open(problem, accuracy=accuracy, restart=kept) as resumed:
    # With the settings that the kernels are written for.
    assert not ti.lang.impl.current_cfg().make_cpu_multithreading_loop
    assert resumed.advance_to(0.002).substep_count > 0
print("told")
"""


@pytest.mark.parametrize("how", ["init", pytest.param("reset", marks=pytest.mark.slow)])
@pytest.mark.thorough
def test_a_session_whose_runtime_was_taken_away_says_so(how):
    command = [sys.executable, "-c", _INTERRUPTED, how]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stdout.endswith("told\n")


def test_an_unsolicited_word_is_never_printed():
    code = "from gasp_taichi_mpm import runtime; runtime.acquire('cpu'); runtime.release()"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == ""


def test_plugin_imports_no_backend():
    code = "import sys, gasp_taichi_mpm.plugin as p; p.gasp_point_engines(); sys.exit('taichi' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


_SMALLEST = """
from gasp_taichi_mpm import runtime

runtime.acquire("cpu")
ti = runtime.taichi

@ti.kernel
def whatever(x: ti.f64) -> ti.f64:
    return x + 1.0

whatever(1.0)
print(float("5e-324") * 1.0)
"""


def test_the_smallest_numbers_are_still_numbers(tmp_path):
    """Taichi would have them flushed to zero in the thread that starts it, in all that runs there afterwards."""
    script = tmp_path / "smallest.py"
    script.write_text(_SMALLEST, encoding="utf-8")
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "5e-324"
