"""The way of a GPU: its kernels and its graphs, run on the CPU with one thread to a block, and compiled for a GPU."""

import re
import sys
from functools import partial

import numpy as np
import pytest
import warp as wp
from gasp_mpm_host import layout as at
from gasp_mpm_host.forcing_tables import Forcing
from gasp_mpm_host.session import FarAwayError, MpmSession, opened
from gasp_mpm_host.testing.agreement import COMPANIES
from gasp_mpm_host.testing.kit import falling
from gasp_mpm_host.testing.tracers import go_alike, traced
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud
from gasp_warp_mpm.engine import WarpMpm
from gasp_warp_mpm.kernels import make_kernels

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


@pytest.mark.parametrize("company", ["rigid and soft", "one that is led", "a rigid part"])
def test_the_way_of_the_gpu_meets_rigid_bodies_where_they_are(kit, company):
    """Nodes and points are read and changed in the device's memory, a row a thread."""
    problem, accuracy = traced(COMPANIES[company]()), EngineAccuracy(spacing=0.05, substep=5e-4)
    by_host = kit.open(problem, precision="float64", spacing=0.05, substep=5e-4)
    go_alike(problem, [by_host, opened(problem, engine="warp-mpm", accuracy=accuracy, build=on_the_cpu())])


@pytest.mark.parametrize("company", [None, "three that deform"])
def test_points_that_are_sorted_where_they_are_come_in_the_order_of_the_host(kit, company):
    problem = traced(falling(kit)) if company is None else COMPANIES[company]()
    accuracy = EngineAccuracy(spacing=0.05)
    by_host = kit.open(problem, precision="float64", spacing=0.05)
    with by_host, opened(problem, engine="warp-mpm", accuracy=accuracy, build=on_the_cpu()) as there:
        one, other = by_host._held, there._held
        assert np.array_equal(one._ids, other._ids)
        assert np.array_equal(one._tables.tiles.numpy(), other._tables.tiles.numpy())
        assert np.array_equal(one._tables.active.numpy(), other._tables.active.numpy())
        assert np.array_equal(one._label_rows(), other._label_rows())
        looked, seen = one.survey(), other.survey()
        assert all(np.array_equal(getattr(looked, name), getattr(seen, name)) for name in ("low", "high", "drift"))


@pytest.mark.parametrize("place", [1e12, np.nan])
def test_a_point_that_is_nowhere_is_found_where_it_is(kit, place):
    accuracy = EngineAccuracy(spacing=0.05)
    with opened(falling(kit), engine="warp-mpm", accuracy=accuracy, build=on_the_cpu()) as session:
        cloud = session._held
        cells = cloud._cell_rows().copy()
        cells[100, 1] = place
        cloud._place(cells)
        with pytest.raises(FarAwayError):
            cloud.sort()


def test_the_way_of_the_gpu_stops_after_the_step_in_which_a_point_drifted(kit):
    """Though the host looks only when the whole batch has been launched."""
    problem = falling(kit, colliders=(), gravity=(0, 0, 0))
    accuracy = EngineAccuracy(spacing=0.02)
    with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=on_the_cpu()) as session:
        cloud = session._held
        start = cloud.positions()
        cloud.begin_batch(0.75 * 0.02 / 2.0, np.zeros(3), Forcing.none(20))
        done, drifted, _ = cloud.steps(0, 20)
        assert drifted
        # Three quarters of a cell a step, from anywhere in a cell, and a cell of slack.
        assert done in (1, 2)
        # Undeformed points fly on as they are.
        travel = np.linalg.norm(cloud.positions() - start, axis=1)
        assert np.abs(travel - done * 0.75 * 0.01 * np.hypot(0.3, 2.0)).max() <= 1e-9


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no compiler for CUDA")
@pytest.mark.parametrize(("double", "averaged"), [(False, False), pytest.param(True, True, marks=pytest.mark.slow)])
@pytest.mark.thorough
def test_compiled_for_a_gpu_points_add_up_in_registers(tmp_path, double, averaged):
    """By NVIDIA's compiler, which comes with Warp and needs no GPU; sm_90 is the first that adds four numbers at once.

    A thread has the sums of 27 nodes, of four numbers or two of dilation, in registers alone, and adds them to the grid
    in one place of its code.
    """
    runtime.device_for("cpu")
    kernels = make_kernels(double, frozenset({"elastic"}), averaged, averaged, atomic=True, native=False)
    [made] = wp.compile_aot_module(kernels.module, arch=90, module_dir=tmp_path, use_ptx=True)
    text = made.read_bytes().decode(errors="replace")
    bodies = {
        name: body
        for name in ("average", "scatter", "move")
        for body in re.findall(rf"\.entry \w*__locals__{name}_\w*_forward\(.*?\n}}", text, flags=re.DOTALL)
    }
    alone = {name: len(re.findall(r"(?:atom|red)\S*\.add\.f\d", body)) for name, body in bodies.items()}
    together = {name: body.count("red.global.add.v4.f32") for name, body in bodies.items()}
    assert (alone["scatter"], together["scatter"]) == ((27 * 4, 0) if double else (0, 27))
    assert (alone["move"], together["move"]) == (0, 0)
    if averaged:
        assert alone["average"] == 27 * 2
    assert not any(".local" in body for body in bodies.values())
