"""What a session has of Genesis: a scene on loan that fits its points, exchanged when they outgrow it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import PointProblem
from gasp_genesis_mpm.colliders import walls_of
from gasp_genesis_mpm.grid_window import Window
from gasp_genesis_mpm.particle_state import Motion, Units
from gasp_genesis_mpm.rest_step import rest_step
from gasp_genesis_mpm.runtime import lender
from gasp_genesis_mpm.stiffness_groups import Portion, portions_of

__all__ = ["Performance"]

Array = NDArray[Any]

_NOTHING = 1e-12
"""Of a stable substep: in less than that, nothing moves by more than rounding. Genesis' masses, which grow with the
inverse square of the substep, would have no number."""


class Performance:
    """A scene of Genesis and the place of its grid.

    Parameters
    ----------
    problem
        What is simulated.
    spacing
        Of the grid [m].
    origin : (3,) [m]
        Of cell coordinates.
    motion
        Of the beginning.
    window
        To begin with; None for one around the points.

    Raises
    ------
    TooWideError
        Where no grid holds the points.
    """

    def __init__(
        self,
        problem: PointProblem,
        spacing: float,
        origin: Array,
        motion: Motion,
        window: Window | None,
    ) -> None:
        self.portions: tuple[Portion, ...] = portions_of(problem)
        self.window = Window.around(motion.cells) if window is None else window
        self._problem = problem
        self._units = Units(spacing=spacing, portions=self.portions, masses=problem.masses)
        self._walls = walls_of(problem.colliders, spacing)
        self._places = np.array([(wall.place - origin) / spacing for wall in self._walls]).reshape(-1, 3)
        bound = min(rest_step(portion.material, spacing) for portion in self.portions)
        self._nothing = _NOTHING * bound
        self._blueprint: Any = None
        self._stage: Any = None
        lender.enter()
        try:
            # Here and not with the first substep, so that what takes seconds is not taken from a frame's time.
            self._fit()
        except BaseException:
            lender.leave()
            raise

    def play(self, motion: Motion, count: int, step: float) -> Motion:
        """The motion after `count` substeps of `step` [s].

        Raises
        ------
        TooWideError
            Where no grid holds the points.
        FloatingPointError
            Where Genesis finds a position that is no number.
        """
        units = self._units
        if step < self._nothing:
            return motion
        self.window = self.window.recentred(motion.cells)
        self._fit()
        shift = np.array(self.window.shift, dtype=np.float64)
        self._stage.write(
            units.numbers(motion, shift, step),
            units.scaled_masses(step),
            units.actuations(step),
            units.scaled_gravity(self._problem.gravity, step),
            self._places - shift,
        )
        try:
            self._stage.step(count)
        except FloatingPointError:
            self._discard()
            raise
        numbers = self._stage.read()
        if not (np.isfinite(numbers.positions).all() and np.isfinite(numbers.velocities).all()):
            self._discard()
        return units.motion(numbers, shift, step)

    def end(self) -> None:
        """Give the scene back."""
        self._give_back()
        lender.leave()

    def _fit(self) -> None:
        """Have the scene that this window wants."""
        from gasp_genesis_mpm.genesis_scene import Blueprint

        wanted = Blueprint(
            half=self.window.half,
            counts=tuple(len(portion.rows) for portion in self.portions),
            laws=self._units.laws(),
            walls=tuple(wall.kind for wall in self._walls),
        )
        if wanted != self._blueprint:
            self._give_back()
            self._stage, self._blueprint = lender.lend(wanted), wanted

    def _discard(self) -> None:
        """Keep a scene from the next session: Genesis empties the nodes it has noted, and notes none without a mass."""
        lender.discard(self._stage)
        self._stage = self._blueprint = None

    def _give_back(self) -> None:
        if self._stage is not None:
            lender.take_back(self._blueprint, self._stage)
            self._stage = self._blueprint = None
