"""The way of a GPU: its kernels and its graphs, run on the CPU with one thread to a block, and compiled for a GPU."""

import itertools
import re
import sys
from functools import partial

import numpy as np
import pytest
import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.session import MpmSession
from gasp_mpm_host.testing.kit import falling, nothing_acts
from gasp_mpm_host.testing.tracers import traced
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud
from gasp_warp_mpm.engine import WarpMpm
from gasp_warp_mpm.kernels import make_kernels
from gasp_warp_mpm.pool import LANES, make_pool

from gasp_core.contract import Driven, EngineAccuracy, Field, SphereShape, Status
from gasp_core.errors import EngineEnvironmentError, SceneError


def on_the_cpu(double=True):
    return partial(Cloud, device=runtime.device_for("cpu"), double=double, threads=1, atomic=True, native=False)


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
    """The order of additions apart, the same arithmetic; what is held turns further in every step of a batch."""
    held = SphereShape(center=(0.2, 0.2, 0.3), radius=0.15)
    turning = Driven(region=held, angular_velocity=(0.0, 3.0, 5.0), center=(0.2, 0.2, 0.3))
    problem = traced(falling(kit, material, drives=(turning,)))
    with kit.open(problem, precision="float64", spacing=0.1) as session:
        assert session.advance_to(0.05).status is Status.OK
        expected = session.read(frozenset(Field))
    accuracy = EngineAccuracy(spacing=0.1)
    with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=on_the_cpu()) as session:
        assert session.advance_to(0.05).status is Status.OK
        found = session.read(frozenset(Field))
        kept = session.checkpoint()
    # Some tens of steps of rounding in another order.
    assert np.abs(found.positions - expected.positions).max() <= 1e-12
    assert np.abs(found.tracer_positions - expected.tracer_positions)[:-3].max() <= 1e-12
    assert np.array_equal(kept["rows"].shape, (512, at.POINT_WIDTH))


def test_the_way_of_the_gpu_stops_after_the_step_in_which_a_point_drifted(kit):
    """Though the host looks only when the whole batch has been launched."""
    problem = falling(kit, colliders=(), gravity=(0, 0, 0))
    accuracy = EngineAccuracy(spacing=0.02)
    with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=on_the_cpu()) as session:
        cloud = session._held
        start = cloud.positions()
        cloud.begin_batch(0.75 * 0.02 / 2.0, np.zeros(3), *nothing_acts(20))
        done, drifted, _ = cloud.steps(0, 20)
        assert drifted
        # Three quarters of a cell a step, from anywhere in a cell, and a cell of slack.
        assert done in (1, 2)
        # Undeformed points fly on as they are.
        travel = np.linalg.norm(cloud.positions() - start, axis=1)
        assert np.abs(travel - done * 0.75 * 0.01 * np.hypot(0.3, 2.0)).max() <= 1e-9


def test_what_threads_of_a_block_take_is_everything_once():
    share_of = make_pool(False).share_of
    for begin, end in [(0, 1), (3, 67), (5, 5 + 512), (7, 7 + 1000), (11, 11)]:
        shares = [share_of(begin, end, lane, LANES) for lane in range(LANES)]
        assert shares[0][0] == begin
        assert shares[-1][1] == end
        assert all(mine[1] == following[0] for mine, following in itertools.pairwise(shares))
        assert max(last - first for first, last in shares) <= -(-(end - begin) // LANES)


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no compiler for CUDA")
@pytest.mark.parametrize(("double", "averaged"), [(False, False), pytest.param(True, True, marks=pytest.mark.slow)])
@pytest.mark.thorough
def test_compiled_for_a_gpu_points_add_up_in_shared_memory(tmp_path, double, averaged):
    """By NVIDIA's compiler, which comes with Warp and needs no GPU; sm_75 is the oldest that it knows.

    A point gives 27 nodes four numbers, or two of dilation, in the block's own memory. To the grid goes each node once.
    """
    runtime.device_for("cpu")
    kernels = make_kernels(double, frozenset({"elastic"}), averaged, averaged, atomic=True, native=False)
    [made] = wp.compile_aot_module(kernels.module, arch=75, module_dir=tmp_path, use_ptx=True)
    text = made.read_bytes().decode(errors="replace")
    bodies = {
        name: body
        for name in ("average", "scatter", "move")
        for body in re.findall(rf"\.entry \w*__locals__{name}_\w*_forward\(.*?\n}}", text, flags=re.DOTALL)
    }
    digits = "f64" if double else "f32"
    within = {name: body.count(f"atom.shared.add.{digits}") for name, body in bodies.items()}
    beyond = {name: len(re.findall(rf"atom(?:\.global)?\.add\.{digits}", body)) for name, body in bodies.items()}
    barriers = {name: body.count("bar.sync") for name, body in bodies.items()}
    assert (within["scatter"], beyond["scatter"]) == (27 * 4, 4)
    assert barriers["scatter"] >= 3
    if averaged:
        assert (within["average"], beyond["average"]) == (27 * 2, 2)
    assert (within["move"], beyond["move"], barriers["move"]) == (0, 0, 0)
