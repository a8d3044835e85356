"""What can be shown of a footage, layer by layer.

A layer knows what it draws (`Elements`) and turns a moment and colours into something packed. `layers_of` lists those a
footage has; another kind of points a recording may hold is one more `Points` there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gasp_core.rendering.footage import Footage, RecordedFootage, Still
from gasp_core.rendering.moving_footage import MovingFootage
from gasp_viewer.colouring import Elements
from gasp_viewer.current_frame import Moment
from gasp_viewer.display_units import SIZE, Stage
from gasp_viewer.faces import PackedFaces, pack_faces, simplex_faces
from gasp_viewer.packing import PackedSplats, pack_splats

__all__ = ["FACE_LIMIT", "LAYERS", "POINT_LIMIT", "Faces", "GaussianLayer", "Layer", "Packed", "PackedPoints"]
__all__ += ["Points", "SolidLayer", "layers_of", "thinned"]

Array = NDArray[Any]

POINT_LIMIT = 60_000
"""Points shown at most: more are thinned."""
FACE_LIMIT = 24_000
"""Triangles shown at most. Each is two copies, and viser handles up to 50,000 copies without a search tree of them."""

LAYERS = {"gaussians": "Gaussians", "triangles": "triangles", "points": "engine points", "solid": "the body inside"}
"""Layers by the name the command line knows, and what the page calls them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedPoints:
    """Dots on the stage.

    Parameters
    ----------
    points : (M, 3) float32
    colours : (M, 3) uint8
    size
        Diameter, in the stage's unit.
    """

    points: Array
    colours: Array
    size: float

    @property
    def nbytes(self) -> int:
        """Memory it takes."""
        return self.points.nbytes + self.colours.nbytes


Packed = PackedSplats | PackedFaces | PackedPoints


class Layer(Protocol):
    """Something that can be shown of every frame."""

    @property
    def elements(self) -> Elements:
        """What is drawn, M of them, in every frame the same."""
        ...

    @property
    def note(self) -> str:
        """What to know about it: how many are left out, and the like; may be empty."""
        ...

    def pack(self, moment: Moment, colours: Array) -> Packed:
        """Its look at a moment in colours (M, 3), 0..1."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianLayer:
    """The Gaussians themselves, and grains of what has flowed.

    Parameters
    ----------
    room
        For so many grains there are rows in every frame, which are nothing where there are fewer: the page draws as
        many Gaussians from the first frame to the last.
    """

    elements: Elements
    stage: Stage
    room: int
    note: str = ""

    def pack(self, moment: Moment, colours: Array) -> PackedSplats:
        """All of them."""
        drawn = moment.drawn
        packed = pack_splats(drawn.splats, colours[drawn.sources], self.stage)
        missing = len(self.elements.gaussians) + self.room - len(packed.buffer)
        return PackedSplats(buffer=np.pad(packed.buffer, ((0, missing), (0, 0)))) if missing else packed


@dataclass(frozen=True, slots=True, kw_only=True)
class Faces:
    """The simplices as small faces.

    Parameters
    ----------
    chosen
        For each body, rows (K_b,) of the simplices that are shown.
    """

    elements: Elements
    stage: Stage
    chosen: tuple[Array, ...]
    note: str

    def pack(self, moment: Moment, colours: Array) -> PackedFaces:
        """Faces of those that are shown."""
        faces = [simplex_faces(body[rows]) for body, rows in zip(moment.simplices, self.chosen)]
        return pack_faces(self.stage.place(np.concatenate(faces)), colours)


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points of one kind.

    Parameters
    ----------
    chosen : (M,)
        Rows of those that are shown.
    read
        Gives all points (P, 3) [m] of a moment.
    size
        Diameter on the stage.
    """

    elements: Elements
    stage: Stage
    chosen: Array
    read: Callable[[Moment], Array]
    size: float
    note: str

    def pack(self, moment: Moment, colours: Array) -> PackedPoints:
        """Those that are shown."""
        return PackedPoints(
            points=self.stage.place(self.read(moment)[self.chosen]).astype(np.float32),
            colours=np.rint(np.clip(colours, 0.0, 1.0) * 255).astype(np.uint8),
            size=self.size,
        )


class SolidLayer:
    """The surface of the body behind a splat file, as dots of the nearest colours; found when it is asked for."""

    def __init__(self, footage: Still, stage: Stage) -> None:
        self._footage = footage
        self._stage = stage

    @cached_property
    def _points(self) -> Points:
        from scipy.spatial import KDTree

        solid = self._footage.solid()
        places = solid.surface_positions()
        if not len(places):
            # Where nothing is enclosed there is nothing to see but that.
            places = self._footage.splats(0).means[:1]
        chosen = thinned(len(places), POINT_LIMIT)
        tree: Any = KDTree(self._footage.splats(0).means)
        owners = np.asarray(tree.query(places[chosen])[1])
        inside = f"{solid.volume:.3g} inside, in units of the file" if solid.volume else "nothing is inside"
        return Points(
            elements=Elements(gaussians=owners, points=np.full(len(chosen), -1)),
            stage=self._stage,
            chosen=chosen,
            read=lambda moment: places,
            size=float(np.clip(solid.spacing * self._stage.unit, SIZE / 500, SIZE / 100)),
            note="; ".join(filter(None, [inside, _thinning(len(chosen), len(places), "points")])),
        )

    @property
    def elements(self) -> Elements:
        """Dots on its surface."""
        return self._points.elements

    @property
    def note(self) -> str:
        """Its volume."""
        return self._points.note

    def pack(self, moment: Moment, colours: Array) -> PackedPoints:
        """All of them: the file has one frame."""
        return self._points.pack(moment, colours)


def layers_of(footage: Footage, stage: Stage, frame: int = 0) -> dict[str, Layer]:
    """The layers a footage has, by name, the first to be shown first; learnt from a frame that is not damaged."""
    start = Moment(footage, frame)
    drawn = _drawn(footage, len(start.splats))
    room = footage.drawn_frames.most_grains if isinstance(footage, RecordedFootage | MovingFootage) else 0
    layers: dict[str, Layer] = {"gaussians": GaussianLayer(elements=drawn, stage=stage, room=room)}
    layers["triangles"] = _faces(footage, start, drawn, stage)
    if isinstance(footage, RecordedFootage):
        layers["points"] = _engine_points(footage, stage)
    elif isinstance(footage, Still):
        layers["solid"] = SolidLayer(footage, stage)
    return layers


def thinned(count: int, limit: int) -> Array:
    """Rows of at most `limit` of `count` things, drawn at random but always the same, in order."""
    if count <= limit:
        return np.arange(count)
    # Every k-th would keep one vertex of every simplex and drop the others.
    return np.sort(np.random.default_rng(0).choice(count, limit, replace=False))


def _drawn(footage: Footage, count: int) -> Elements:
    """The drawn Gaussians; each goes with the engine's point that leads it, its mean where nothing is reduced."""
    points = np.full(count, -1)
    if isinstance(footage, RecordedFootage):
        for body in footage.recording.bodies:
            points[body.rows] = body.points.start + body.carrier.leaders
    return Elements(gaussians=np.arange(count), points=points)


def _faces(footage: Footage, start: Moment, drawn: Elements, stage: Stage) -> Faces:
    if isinstance(footage, RecordedFootage):
        rows = [body.rows for body in footage.recording.bodies]
    else:
        rows = [drawn.gaussians]
    faces = [1 if body.shape[1] == 3 else 4 for body in start.simplices]
    total = sum(len(own) * each for own, each in zip(rows, faces))
    share = min(1.0, FACE_LIMIT / total)
    chosen = tuple(thinned(len(own), int(len(own) * share)) for own in rows)
    owners = np.concatenate([np.repeat(own[kept], each) for own, kept, each in zip(rows, chosen, faces)])
    return Faces(
        elements=Elements(gaussians=owners, points=drawn.points[owners]),
        stage=stage,
        chosen=chosen,
        note=_thinning(len(owners), total, "triangles"),
    )


def _engine_points(footage: RecordedFootage, stage: Stage) -> Points:
    recording = footage.recording
    owners = np.concatenate([body.rows[body.carrier.followers] for body in recording.bodies])
    chosen = thinned(len(owners), POINT_LIMIT)
    return Points(
        elements=Elements(gaussians=owners[chosen], points=chosen),
        stage=stage,
        chosen=chosen,
        read=lambda moment: moment.points,
        # A quarter of the grid's spacing, but neither dust nor balls.
        size=float(np.clip(recording.header.spacing * stage.unit / 4, SIZE / 500, SIZE / 100)),
        note=_thinning(len(chosen), len(owners), "points"),
    )


def _thinning(shown: int, total: int, what: str) -> str:
    return "" if shown == total else f"{shown:,} of {total:,} {what}, drawn at random"
