"""What light passes on its way, against the same written out node by node."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gasp_core.solid.light import light_through

DIRECTIONS = [way for way in itertools.product(range(-2, 3), repeat=3) if math.gcd(*way) == 1]
DARK = 1e3


def passed(depth, place, way, ground):
    """Optical depth between a node and the sky: of the node a step on, of the mean of those between, and so on."""

    def at(node):
        return float(depth[node]) if all(0 <= one < size for one, size in zip(node, depth.shape)) else None

    onward = tuple(one + step for one, step in zip(place, way))
    here = at(onward)
    if here is None:
        here = DARK if ground and onward[2] < 0 else 0.0
    else:
        here += passed(depth, onward, way, ground)
    if max(map(abs, way)) == 2:
        halves = itertools.product(*({math.floor(step / 2), math.ceil(step / 2)} for step in way))
        found = [at(tuple(one + half for one, half in zip(place, step))) or 0.0 for step in halves]
        here += sum(found) / len(found)
    return here


@pytest.mark.parametrize("ground", [False, True])
def test_light_is_weakened_by_what_it_passes(ground):
    rng = np.random.default_rng(0)
    depth = rng.exponential(0.5, (4, 5, 6)) * (rng.uniform(size=(4, 5, 6)) < 0.4)
    found = light_through(depth, ground)
    for place in itertools.product(*map(range, depth.shape)):
        light = {way: math.exp(-passed(depth, place, way, ground)) for way in DIRECTIONS}
        free = [light[way] * light[tuple(-step for step in way)] for way in DIRECTIONS]
        flow = sum(np.array(way) / np.linalg.norm(way) * one for way, one in light.items()) / len(light)
        # Sums of a dozen depths of up to 4 in float32: 1e-6 of each, in the exponent.
        assert len(light) == 98
        assert found.share[place] == pytest.approx(sum(light.values()) / 98, abs=5e-6)
        assert found.lines[place] == pytest.approx(sum(free) / 98, abs=5e-6)
        assert found.flow[(slice(None), *place)] == pytest.approx(flow, abs=5e-6)
