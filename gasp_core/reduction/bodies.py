"""What is simulated of an object, and the way back: from its displaced points to its Gaussians."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from gasp_core.control import control
from gasp_core.dynamics.composition import PrescribedMotion, drifted
from gasp_core.games import invert_simplices, matter_rotations
from gasp_core.gaussians import Gaussians
from gasp_core.reduction.all_vertices import Block
from gasp_core.reduction.transfer_operator import TransferOperator
from gasp_core.scene.settings import MapChoice

__all__ = [
    "Body",
    "MovedGaussians",
    "carried_simplices",
    "matter_turns",
    "moved_gaussians",
    "moved_simplices",
    "shapes",
]

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """What is simulated of one object.

    Parameters
    ----------
    name
        Of the object.
    rows : (N,)
        Its moving Gaussians, as rows of the whole drawn scene.
    points
        Its rows of the engine's points.
    block
        Its simplices.
    carrier
        How the motion of its points becomes that of its simplices.
    notes
        Sentences for the user about the reduction, without their subject; none in a body read from a recording.
    drift
        How it moves by itself while it is simulated; None where it does not, and in a body read from a recording that
        keeps of every frame how far it went.
    driven : (M,) or None
        Which of its Gaussians go where they move by themselves, whatever the points do; the drift is theirs alone.
        None: all have moved by themselves before the points move them.
    strained
        Whether what is told of how it moves by itself is what the engine's deformation gradients do to its simplices,
        see `gasp_core.reduction.centres`.
    """

    name: str
    rows: Array
    points: slice
    block: Block
    carrier: TransferOperator
    notes: tuple[str, ...] = ()
    drift: PrescribedMotion | None = None
    driven: Array | None = None
    strained: bool = False

    @property
    def drifting(self) -> tuple[int, int, int]:
        """Shape (M, V, 3) of what is told of how it moves by itself."""
        count, vertices, _ = self.block.rest.shape
        return (count if self.driven is None else len(self.driven)), vertices, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedGaussians:
    """T^-1 of a body's displaced points.

    Parameters
    ----------
    gaussians
        Means about the block's centre; the harmonics are those at rest, not turned.
    degenerate : (N,) bool
        Where a simplex gives no frame.
    clipped : (N,) bool
        Where the control rule bounded a stretch.
    simplices : (N, V, 3) [m]
        What was inverted, about the block's centre.
    """

    gaussians: Gaussians
    degenerate: Array
    clipped: Array
    simplices: Array


def moved_simplices(body: Body, displacements: Array, drift: Array | None = None, shift: Array | None = None) -> Array:
    """Simplices (N, V, 3), not magnified, about the block's centre, of points displaced by (P, 3) [m].

    At displacement zero they are those at rest to the last bit, or where they have drifted to by `Body.drifting` [m].
    `shift` (3,) [m] is the common translation that the displacements are less.
    """
    return carried_simplices(body, displacements, drift, shift)[0]


def carried_simplices(
    body: Body, displacements: Array, drift: Array | None, shift: Array | None = None
) -> tuple[Array, Array | None]:
    """The same, and those (N, V, 3) that physics has moved there; None: they are those at rest."""
    rest = body.block.rest
    if drift is None:
        return body.carrier.carry(rest, displacements), None
    if body.driven is None:
        before = drifted(rest, drift)
        # F is physics: what it stretches is bounded.
        return body.carrier.carry(rest, displacements, before), None if body.strained else before
    moved, before = body.carrier.carry(rest, displacements), rest.copy()
    moved[body.driven] = drifted(rest[body.driven], drift) - (0.0 if shift is None else shift)
    # What is driven has been stretched by nothing else.
    before[body.driven] = moved[body.driven]
    return moved, before


def moved_gaussians(
    body: Body,
    displacements: Array,
    maps: MapChoice,
    *,
    previous: Gaussians | None = None,
    drift: Array | None = None,
    shift: Array | None = None,
) -> MovedGaussians:
    """Control rule and T^-1 of a body's displaced points.

    Parameters
    ----------
    body
        Whose points.
    displacements : (P, 3) [m]
        From the positions at the start, less any common translation.
    maps
        Which inverse and which bound.
    previous
        Source of the frames of simplices that have none.
    drift : `Body.drifting` [m]
        How far the body has moved by itself, as `drifted` takes it.
    shift : (3,) [m]
        The common translation.
    """
    moved, before = carried_simplices(body, displacements, drift, shift)
    return shapes(moved, body.block.local, maps, previous=previous, before=before)


def shapes(
    simplices: Array,
    reference: Gaussians,
    maps: MapChoice,
    *,
    previous: Gaussians | None = None,
    before: Array | None = None,
) -> MovedGaussians:
    """Control rule and T^-1 of moved simplices (N, V, 3) whose Gaussians at rest are `reference`.

    `before` are those that physics moved where they are not those at rest.
    """
    simplices, clipped = control(simplices, reference, maps.alpha, maps.covariance, before, maps.control)
    # Constant colour has nothing to turn: T^-1 is then about shapes alone.
    plain = reference.with_(harmonics=reference.harmonics[:, :1])
    inverted = invert_simplices(simplices, reference=plain, covariance=maps.covariance, previous=previous)
    return MovedGaussians(
        gaussians=inverted.gaussians.with_(harmonics=reference.harmonics),
        degenerate=inverted.degenerate,
        clipped=clipped,
        simplices=simplices,
    )


def matter_turns(body: Body, moved: MovedGaussians) -> Array:
    """How far the matter of each of a body's Gaussians has turned since the start, rotations (N, 3, 3)."""
    return matter_rotations(moved.simplices, body.block.local, moved.degenerate)
