"""Which end of a capture is down."""

import numpy as np
import pytest

from gasp_core import Gaussians, read_splat
from gasp_core.scene.floaters import floating
from gasp_core.scene.objects import UP_AXES
from gasp_core.scene.placement import upright
from gasp_core.scene.standing import guess_up, support_shares
from gasp_core.toy import make_toy

# What MANIFEST.md says of them; the statue is there twice, and one of the two is y up.
CAPTURES = {
    "splats/plant.splat": "-y",
    "splats/skull.sog": "-y",
    "splats/guitar.compressed.ply": "-y",
    "splats/statue-st-peter.sog": "-y",
    "splats/statue-angel.sog": "-y",
    "splats/statue-angel.compressed.ply": "+y",
    "splats/statue-massa.sog": "-y",
    "splats/playbot/4_0": "-y",
    "meshlike/spot_10k.splat": "-y",
}


@pytest.mark.parametrize("name", CAPTURES)
def test_captures_stand_upright(data, name):
    gaussians = read_splat(data / name)
    axis, _ = guess_up(gaussians.select(~floating(gaussians.means)))
    assert axis == CAPTURES[name]


def cone(axis):
    """A cone that stands on its base once `axis` is up."""
    rng = np.random.default_rng(0)
    heights = 1 - np.cbrt(rng.random(4000))
    angle, radius = 2 * np.pi * rng.random(4000), (1 - heights) * np.sqrt(rng.random(4000)) / 2
    means = np.stack([radius * np.cos(angle), radius * np.sin(angle), heights], axis=1) @ upright(axis)
    return Gaussians(
        means=means,
        quaternions=np.tile([1.0, 0, 0, 0], (4000, 1)),
        scales=np.full((4000, 3), 0.01),
        opacities=np.ones(4000),
        harmonics=np.zeros((4000, 1, 3)),
    )


@pytest.mark.parametrize("axis", ["-y", "+y", "+z", "-z"])
def test_a_cone_stands_on_its_base(axis):
    assert guess_up(cone(axis)) == (axis, True)
    shares = support_shares(cone(axis).means, UP_AXES)
    assert shares[axis] > 0.9 and max(share for other, share in shares.items() if other != axis) < 0.5


def test_what_stands_on_nothing_is_taken_to_be_as_files_are():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(2000, 3))
    ball = cone("+z").select(np.arange(2000)).with_(means=points / np.linalg.norm(points, axis=1, keepdims=True))
    assert guess_up(ball) == ("-y", False)


def test_few_and_faint_gaussians_are_no_error():
    toy = make_toy(64)
    for few in (toy.select(np.arange(0)), toy.select(np.arange(2)), toy.with_(opacities=np.zeros(64))):
        assert guess_up(few) == ("-y", False)
