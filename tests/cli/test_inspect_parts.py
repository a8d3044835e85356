"""What ``gasp inspect`` says of the components that parts of an object may be named by, and a run of those it takes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gasp_core import Gaussians, Recording
from gasp_core.io import write_splat

PART = """
[[object.part]]
name = "pot"
component = {component}
material = {{ model = "elastic", density = 900, youngs_modulus = 1e5, poissons_ratio = 0.3 }}
"""


@pytest.fixture
def balls(workplace):
    """Three balls side by side along x, of 500, 300 and 400 Gaussians, most of the first of them faint."""
    counts = (500, 300, 400)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(sum(counts), 3))
    means = directions / np.linalg.norm(directions, axis=1, keepdims=True) * rng.uniform(0, 0.5, (len(directions), 1))
    means[:, 0] += 4.0 * np.repeat(np.arange(3), counts)
    write_splat(
        workplace / "balls.ply",
        Gaussians(
            means=means,
            quaternions=rng.normal(size=(len(means), 4)),
            scales=np.full(means.shape, 0.02),
            opacities=np.where(np.arange(len(means)) < 450, 0.05, 0.9),
            harmonics=np.zeros((len(means), 1, 3), dtype=np.float32),
        ),
    )
    return "balls.ply"


def components(gasp, *arguments):
    outcome = gasp("inspect", *arguments)
    assert (outcome.status, outcome.err) == (0, "")
    (line,) = [line for line in outcome.out.splitlines() if line.startswith("    components")]
    told = json.loads(gasp("inspect", *arguments, "--json").out)["parts"]
    return line, told["components"], told["drawn"]


def test_components_are_those_of_an_object_of_this_min_opacity(gasp, balls, workplace):
    line, sizes, drawn = components(gasp, balls)
    assert "1: 500, 2: 400, 3: 300" in line and "not drawn" not in line
    assert (sizes, drawn) == ([500, 400, 300], 1200)
    line, sizes, drawn = components(gasp, balls, "--min-opacity", "0.1")
    assert line.endswith("1: 400, 2: 300, 3: 50; 450 Gaussians are not drawn and in none")
    assert (sizes, drawn) == ([400, 300, 50], 750)
    scene = (workplace / "scene.toml").read_text().replace("toy.ply", balls)
    scene = scene.replace("[engine]", PART.format(component=3) + "\n[engine]")
    for least, count in ((0.0, 300), (0.1, 50)):
        (workplace / "scene.toml").write_text(scene.replace("height = 0.3", f"height = 0.3\nmin_opacity = {least}"))
        outcome = gasp("run", "scene.toml", "--overwrite")
        assert outcome.status == 0, outcome
        told = f'object "toy": part "pot" is component 3, of {count} Gaussians around ('
        assert told in outcome.out
        assert any(note.startswith(told) for note in Recording.open("scene.gasp").notes)


def test_where_nothing_is_drawn_there_are_no_components(gasp, balls):
    line, sizes, drawn = components(gasp, balls, "--min-opacity", "1")
    assert line == "    components   none; 1,200 Gaussians are not drawn and in none" and (sizes, drawn) == ([], 0)


def test_the_box_in_a_scene_is_of_what_is_drawn(gasp, balls):
    boxes = [
        json.loads(gasp("inspect", balls, "--height", "1", "--up", "+z", "--json", *more).out)["scene"]
        for more in ((), ("--min-opacity", "0.1"))
    ]
    assert boxes[0]["lowest"] != boxes[1]["lowest"]


@pytest.mark.parametrize("least", ["-0.1", "1.1", "much"])
def test_an_opacity_is_between_none_and_all(balls, refused, least):
    refused("inspect", balls, "--min-opacity", least, says=["--min-opacity", least])
