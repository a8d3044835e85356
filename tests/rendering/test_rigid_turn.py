"""A splat that was turned as a rigid body looks, from a camera turned with it, as it did before."""

import dataclasses
import importlib.util

import numpy as np
import pytest

from gasp_core import Elastic, MapChoice, Scene, SplatObject, simulate
from gasp_core.accuracy.images import psnr
from gasp_core.gaussians import rotation_matrices
from gasp_core.reduction.bodies import matter_turns, moved_gaussians
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera_files import placed
from gasp_core.rendering.footage import open_footage
from gasp_core.rendering.framing import frame_motion, motion_of
from gasp_core.rendering.renderers import open_renderer
from gasp_core.scene.placement import Placement
from gasp_core.simulation.splat_sources import prepare

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("gasp_renderer") is None, reason="no renderer here: pip install -e plugins/renderer"
)

SHIFT = np.array([0.3, -0.2, 0.5])


@pytest.fixture(scope="module")
def skull(data):
    return data / "splats" / "skull.sog"


@pytest.fixture(scope="module")
def prepared(skull):
    jelly = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    return prepare(Scene(duration=1, frame_rate=1, objects=(SplatObject(name="skull", splat=skull, material=jelly),)))


@pytest.fixture(scope="module")
def camera(skull):
    return frame_motion(motion_of(open_footage(skull)), width=256, height=256, around=35, above=18)


def moved_as_one(prepared, rotation):
    """T, the engine's place taken by a rigid motion of its points, float32 as recordings keep it, T^-1."""
    (body,) = prepared.assembly.bodies
    start = prepared.assembly.problem.points.reference_positions
    displacements = start @ rotation.T + SHIFT - start
    mean = displacements.mean(axis=0)
    moved = moved_gaussians(body, (displacements - mean).astype(np.float32), MapChoice())
    means = moved.gaussians.means + body.block.centre + mean
    return dataclasses.replace(RenderInput.of(moved.gaussians), means=means, turns=matter_turns(body, moved))


def over_white(renderer, splats, camera):
    return np.clip(renderer.render(splats, camera).over(np.ones(3)), 0, 1)


@pytest.mark.parametrize(
    "quaternion",
    [(0.9, 0.1, -0.3, 0.2), *(pytest.param(q, marks=pytest.mark.slow) for q in ((0.1, 0.9, 0.3, -0.2), (0, 0, 0, 1)))],
)
@pytest.mark.thorough
def test_turned_with_its_camera_it_looks_the_same(prepared, camera, quaternion):
    (rotation,) = rotation_matrices(np.array([quaternion]))
    turned = moved_as_one(prepared, rotation)
    assert turned.sh_degree == 3
    renderer = open_renderer()
    turned_camera = placed(camera, Placement(rotation=rotation, scale=1.0, translation=SHIFT))
    before = over_white(renderer, RenderInput.of(prepared.objects[0].gaussians), camera)
    after = psnr(before, over_white(renderer, turned, turned_camera))
    unturned = psnr(before, over_white(renderer, dataclasses.replace(turned, turns=None), turned_camera))
    print(f"turned: {after:.1f} dB; colours left behind: {unturned:.1f} dB")
    assert after >= 50
    # Visibly worse: an error of one part in thirty of what can be shown, root mean square, is 30 dB.
    assert unturned < 30


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["plant.splat", "skull.sog"])
def test_the_first_frame_of_a_run_looks_as_its_file_does(data, name):
    jelly = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3)
    item = SplatObject(name="it", splat=data / "splats" / name, material=jelly)
    run = simulate(Scene(duration=1, frame_rate=1, objects=(item,)), frames=1, progress=False)
    still = open_footage(data / "splats" / name)
    camera = frame_motion(motion_of(still), width=256, height=256, around=35, above=18)
    renderer = open_renderer()
    alike = psnr(over_white(renderer, still.splats(0), camera), over_white(renderer, run.splats(0), camera))
    print(f"{name}: {alike:.1f} dB")
    # The maps go through float64: what is left is the rounding of float32 colours, 6e-8 or 144 dB, in a sum of many.
    assert alike >= 120
