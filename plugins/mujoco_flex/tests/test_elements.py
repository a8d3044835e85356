from __future__ import annotations

import numpy as np
import pytest
from gasp_mujoco_flex.elements import cell_stiffness, elasticity

from gasp_core.stepping.embedding import CORNERS

SIDES = np.array([0.3, 0.2, 0.5])
PLACES = CORNERS * SIDES
ROUNDING = 1e-12
"""Over the stiffness: some hundred operations in double precision."""


@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.499])
def test_stiffness_is_symmetric_and_has_six_rigid_motions(ratio):
    stiffness = cell_stiffness(SIDES, elasticity(1e5, ratio))
    scale = np.abs(stiffness).max()
    assert np.abs(stiffness - stiffness.T).max() <= ROUNDING * scale
    values = np.linalg.eigvalsh((stiffness + stiffness.T) / 2)
    assert np.abs(values[:6]).max() <= ROUNDING * scale
    # All others cost energy: the softest is a bending mode, far from zero.
    assert values[6] > 1e-3 * values[8] > 0


@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.499])
def test_a_constant_strain_has_the_energy_of_hookes_law(ratio):
    law = elasticity(1e5, ratio)
    stiffness = cell_stiffness(SIDES, law)
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    moved = (PLACES @ gradient.T).ravel()
    e = (gradient + gradient.T) / 2
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[1, 2], 2 * e[2, 0]])
    expected = strain @ law @ strain * SIDES.prod()
    assert moved @ stiffness @ moved == pytest.approx(expected, rel=1e-10)


def test_a_cell_bends_as_a_beam_does():
    # Curvature k of a box with nu = 0: energy E I k^2 l / 2, I = b h^3 / 12. Corners of u = (x z, 0, -x^2 / 2).
    stiffness = cell_stiffness(SIDES, elasticity(1e5, 0.0))
    x, _, z = (PLACES - SIDES / 2).T
    moved = np.stack([x * z, 0 * x, -(x**2) / 2], axis=1).ravel()
    length, width, height = SIDES
    expected = 1e5 * width * height**3 / 12 * length
    assert moved @ stiffness @ moved == pytest.approx(expected, rel=1e-10)


def test_keeping_its_volume_stiffens_a_cell_in_one_motion_alone():
    # What a ratio near to 1/2 forbids is that its volume changes; a cell that locks is stiffened in others as well.
    nearly, more_nearly = (
        np.linalg.eigvalsh(cell_stiffness(SIDES, elasticity(1e5, ratio))) for ratio in (0.4999, 0.499999)
    )
    assert (more_nearly[6:] > 2 * nearly[6:]).sum() == 1
