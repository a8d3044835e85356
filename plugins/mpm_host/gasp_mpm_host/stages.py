"""Steps in three parts, between which the host has a word: for what the grid does not know."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any, Protocol

from numpy.typing import NDArray

from gasp_mpm_host.scaling import Units

__all__ = ["InterruptedSteps", "Intervention", "Stage", "StagedCloud"]

Array = NDArray[Any]


class Stage(Enum):
    """A part of a step.

    Attributes
    ----------
    SCATTER
        Points to nodes: these then hold momentum and mass.
    UPDATE
        What acts on nodes, which then hold velocities.
    MOVE
        Nodes to points, and to tracers.
    """

    SCATTER = "scatter"
    UPDATE = "update"
    MOVE = "move"


class StagedCloud(Protocol):
    """What a `gasp_mpm_host.session.SteppedCloud` can do besides, for `InterruptedSteps`."""

    units: Units

    def begin_stages(self, index: int, first: int) -> None:
        """Step `index` of the batch is the next, and the first since bodies were looked at is step `first`."""
        ...

    def stage(self, stage: Stage, index: int) -> None:
        """Do a part of step `index`."""
        ...

    def end_stages(self) -> tuple[bool, bool]:
        """Whether a point drifted in this step, whether the edge held any."""
        ...

    def rows_of(self, nodes: Array, bodies: Array) -> Array:
        """Where nodes (K, 3) of bodies (K,) are in the grid's memory, (K,); their coordinates are the scene's."""
        ...

    def node_rows(self, rows: Array) -> Array:
        """Nodes in rows (K,) of the grid: (K, 4) in the engine's units."""
        ...

    def put_nodes(self, rows: Array, nodes: Array) -> None:
        """Give nodes in rows (K,) momenta and masses (K, 4) in the engine's units, before the update."""
        ...

    def put_velocities(self, rows: Array, velocities: Array) -> None:
        """Give nodes in rows (K,) velocities (K, 3), also where tracers read them."""
        ...

    def rows_of_points(self, points: Array) -> Array:
        """Where points (K,) of the scene are in the engine's own order, (K,)."""
        ...

    def all_cells(self) -> Array:
        """Places (N, 3) of all points in the scene, in cells."""
        ...

    def traits(self, rows: Array) -> tuple[Array, Array, Array, Array]:
        """Of points in rows (K,): half widths (K,), masses (K,), bodies (K,), whether they flow (K,)."""
        ...

    def moving(self, rows: Array) -> tuple[Array, Array]:
        """Of points in rows (K,): places (K, 3) in the scene, in cells, and velocities (K, 3)."""
        ...

    def put_points(self, rows: Array, cells: Array, velocities: Array) -> None:
        """Put points in rows (K,) at places (K, 3) in the scene, in cells, with velocities (K, 3)."""
        ...

    def nudge(self, rows: Array, change: Array, step: float) -> None:
        """Change the velocities of points in rows (K,) by (K, 3), as if it had been so during the last step."""
        ...


class Intervention(Protocol):
    """What the host does between the parts of steps."""

    def begin_batch(self, begin: float, step: float, count: int, allowed: float) -> None:
        """The next `count` steps of `step` [s], which may be as long as `allowed` [s], begin at `begin` [s]."""
        ...

    def begin_steps(self, index: int) -> None:
        """Before step `index` of the batch, which is the first, or the points have been sorted anew."""
        ...

    def before_update(self, index: int) -> None:
        """The nodes hold momenta and masses."""
        ...

    def after_update(self, index: int) -> None:
        """They hold velocities."""
        ...

    def after_move(self, index: int) -> None:
        """The points have moved."""
        ...


class InterruptedSteps:
    """Steps of a cloud in which others have a word, in the order given.

    Parameters
    ----------
    cloud
        What the engine steps.
    interventions
        At least one.
    """

    def __init__(self, cloud: StagedCloud, interventions: Sequence[Intervention]) -> None:
        self._cloud, self._interventions = cloud, tuple(interventions)

    def begin_batch(self, begin: float, step: float, count: int, allowed: float) -> None:
        """See `Intervention`."""
        for each in self._interventions:
            each.begin_batch(begin, step, count, allowed)

    def steps(self, first: int, end: int) -> tuple[int, bool, bool]:
        """Do steps first..end of the batch; see `gasp_mpm_host.session.SteppedCloud.steps`."""
        cloud = self._cloud
        for each in self._interventions:
            each.begin_steps(first)
        clamped = False
        for index in range(first, end):
            cloud.begin_stages(index, first)
            cloud.stage(Stage.SCATTER, index)
            for each in self._interventions:
                each.before_update(index)
            cloud.stage(Stage.UPDATE, index)
            for each in self._interventions:
                each.after_update(index)
            cloud.stage(Stage.MOVE, index)
            for each in self._interventions:
                each.after_move(index)
            drifted, held = cloud.end_stages()
            clamped |= held
            if drifted:
                return index + 1 - first, True, clamped
        return end - first, False, clamped
