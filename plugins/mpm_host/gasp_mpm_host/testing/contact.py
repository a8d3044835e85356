"""What two bodies give each other where they meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_core.contract import BodyContact, ContactCondition, PointProblem, Status
from gasp_mpm_host import layout as at
from gasp_mpm_host.session import MpmSession
from gasp_mpm_host.testing.kit import Kit

__all__ = ["ContactTests"]

Array = NDArray[Any]

_SIDE, _SPACING, _STEP, _STEPS = 0.2, 0.05, 2e-4, 500
_TOLERANCE = {"float64": 1e-12, "float32": 1e-6}
"""Of what one body has: 500 steps' rounding, which does not add up in one direction, since it is that of momenta whose
sum is exchanged with opposite signs."""


def _collision(contact: BodyContact) -> PointProblem:
    """A spinning block that hits another one off its middle, and askew to it and to the grid."""
    resting = Kit.block(_SIDE, 6, (0.0, 0.0, 0.0), seed=1)
    flying = Kit.block(_SIDE, 6, (-0.23, 0.07, 0.03), seed=2)
    spin = np.cross([0.0, 3.0, 6.0], flying - flying.mean(axis=0))
    ids = np.repeat([0, 1], len(resting))
    velocity = np.concatenate([np.zeros_like(resting), np.array([2.0, -0.3, 0.1]) + spin])
    return Kit.problem(
        np.concatenate([resting, flying]),
        (Kit.materials["elastic"], Kit.materials["neo-hookean"]),
        ids=ids,
        volumes=np.full(len(ids), _SIDE**3 / len(resting)),
        velocity=velocity,
        gravity=(0.0, 0.0, 0.0),
        body_contact=contact,
    )


def _momenta(kit: Kit, session: MpmSession, problem: PointProblem) -> tuple[Array, Array]:
    """Linear (2, 3) [kg m/s] and angular momenta (2, 3) [kg m^2/s] of the bodies, about the origin.

    What points carry about themselves, m dx^2/4 C, turns as well.
    """
    state, rows = session.read(kit.everything), kit.rows(session)
    assert state.velocities is not None
    affine = np.empty((len(rows.ids), 3, 3))
    affine[rows.ids] = rows.points[:, at.AFFINE : at.AFFINE + 9].reshape(-1, 3, 3)
    affine /= session._units.time  # pyright: ignore[reportPrivateUsage]
    own = (_SPACING**2 / 4) * np.stack(
        [affine[:, 2, 1] - affine[:, 1, 2], affine[:, 0, 2] - affine[:, 2, 0], affine[:, 1, 0] - affine[:, 0, 1]],
        axis=1,
    )
    masses = problem.masses[:, None]
    linear = masses * state.velocities
    angular = masses * (np.cross(state.positions, state.velocities) + own)
    bodies = problem.points.body_ids
    return (
        np.array([linear[bodies == body].sum(axis=0) for body in (0, 1)]),
        np.array([angular[bodies == body].sum(axis=0) for body in (0, 1)]),
    )


class ContactTests:
    """That contact takes from one body what it gives to the other; a subclass finds the fixture `kit`, a `Kit`."""

    @pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.thorough)])
    @pytest.mark.parametrize(
        "contact",
        [
            BodyContact(friction=0.4),
            *(
                pytest.param(BodyContact(contact=one), marks=pytest.mark.thorough)
                for one in (ContactCondition.SLIP, ContactCondition.STICK)
            ),
        ],
        ids=lambda contact: contact.contact.value,
    )
    def test_momentum_and_angular_momentum_are_exchanged(self, kit, contact, precision):
        problem = _collision(contact)
        with kit.open(problem, precision=precision, spacing=_SPACING, substep=_STEP) as session:
            before = _momenta(kit, session, problem)
            assert session.advance_to(_STEP * _STEPS).status is Status.OK
            after = _momenta(kit, session, problem)
        for start, end in zip(before, after):
            scale = np.linalg.norm(start[1])
            assert np.linalg.norm(end[0]) > 0.1 * scale  # they met
            assert np.linalg.norm(end.sum(axis=0) - start.sum(axis=0)) <= _TOLERANCE[precision] * scale
