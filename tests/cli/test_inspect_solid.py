"""``gasp inspect --solid``."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from splat_shells import SHAPES, discs, shell

from gasp_core.io import write_splat


@pytest.fixture
def ball(workplace):
    write_splat(workplace / "ball.ply", shell(SHAPES["sphere"], count=4_000))
    return "ball.ply"


@pytest.fixture
def inspect(gasp):
    def run(*arguments):
        outcome = gasp("inspect", *arguments)
        assert (outcome.status, outcome.err) == (0, "")
        return outcome.out

    return run


def test_it_tells_the_body_and_draws_it(ball, inspect, workplace):
    text = inspect(ball, "--solid", "--up", "+z")
    assert "in 1 part, give or take" in text and "ball.solid.png" in text
    with Image.open(workplace / "ball.solid.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    # Blue is what is inside.
    assert (pixels[..., 2] - pixels[..., 0] > 60).mean() > 0.05


def test_numbers_are_those_of_a_scene_where_a_height_is_given(ball, inspect):
    told = json.loads(inspect(ball, "--solid", "--height", "0.2", "--up", "+z", "--json"))
    assert told["solid"]["volume"] == pytest.approx(0.2**3 * np.pi / 6, rel=0.03)
    assert told["solid"]["centre"] == pytest.approx([0, 0, 0.1], abs=0.002)
    assert told["solid"]["parts"] == 1
    assert told["scene"]["lowest"][2] == pytest.approx(0.0, abs=0.01)
    assert told["scene"]["highest"][2] == pytest.approx(0.2, abs=0.01)


def test_a_height_alone_tells_where_things_are(ball, inspect, workplace):
    text = inspect(ball, "--height", "0.2")
    assert "at position 0 0 0" in text and "solid" not in text
    assert not list(workplace.glob("*.png"))


def test_a_splat_that_encloses_nothing_says_so(inspect, workplace):
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (2_000, 3)) * [1, 1, 0]
    up = np.tile([0.0, 0.0, 1.0], (2_000, 1))
    write_splat(workplace / "sheet.ply", discs(points, up, np.full((2_000, 2), 0.03), np.full(2_000, 0.9), rng))
    text = inspect("sheet.ply", "--solid", "--up", "+z", "--slices", "slices.png")
    assert "enclose no volume" in text and "of sheets" in text
    assert (workplace / "slices.png").exists()


def test_a_picture_that_cannot_be_written_is_one_line(ball, refused):
    refused("inspect", ball, "--solid", "--slices", "no/such/folder/slices.png", says=["cannot be written"])


def test_a_height_of_nothing_is_refused(ball, refused):
    refused("inspect", ball, "--height", "0", says=["height"])
