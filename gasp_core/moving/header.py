"""``motion.json`` of a moving splat: what moves, how it is written, and the room that it moves in."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.io.sog_meta import Meta, parse_meta
from gasp_core.moving.carriers import KINDS

__all__ = ["COLLIDERS", "FOLDER", "HEADER", "VERSION", "BodyHeader", "MotionHeader"]

HEADER = "motion.json"
FOLDER = "motion/"
COLLIDERS = FOLDER + "colliders/"
FORMAT = "gasp-moving-splat"
VERSION = 2
_FREE = "free"
_MOST_FRAMES = 10**6
_MOST_BODIES = 1000
_MOST_OBJECTS = 10_000
_MOST_FRAMES_A_BLOCK = 1000
_MOST_GRAINS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyHeader:
    """Gaussians that move together.

    Parameters
    ----------
    name
        Of the object.
    first, last
        Their rows of the splat, `last` not among them.
    kind
        How they are carried: "volume" and "cores" by points, "free" each by itself.
    points
        That carry them; 0 where each is free.
    spacing
        Mean distance of the points [m]; 0 where it is not known.
    centre : (3,) [m]
        In the world, about which points and Gaussians are carried.
    grains
        How many a point comes apart into where it flows; 0 where nothing does.
    grain_scale
        Standard deviation of a grain [m].
    """

    name: str
    first: int
    last: int
    kind: str
    points: int
    spacing: float
    centre: tuple[float, ...]
    grains: int = 0
    grain_scale: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionHeader:
    """All of ``motion.json``.

    Parameters
    ----------
    frames
        How many there are.
    frames_a_block
        How many of them lie in one file.
    frame_rate
        [1/s]
    origin : (3,) [m]
        Of the splat, in the world, where x, y, z are right, back and up.
    quantum
        Of displacements [m].
    largest_error
        How far any mean of any frame is from where it was recorded [m].
    alpha
        How much no Gaussian is stretched, see `gasp_core.control`; None: no bound.
    bodies
        In the order of their rows.
    objects
        Of every object its rows of the splat, the last not among them, those too that do not move; empty where a file
        does not say it.
    camera, colliders
        What a player begins with, and what is solid; for whom it may concern.
    version
        Of the format.
    """

    frames: int
    frames_a_block: int
    frame_rate: float
    origin: tuple[float, ...]
    quantum: float
    largest_error: float
    alpha: float | None
    bodies: tuple[BodyHeader, ...]
    objects: tuple[tuple[int, int], ...] = ()
    camera: Mapping[str, Any] | None = None
    colliders: Sequence[Mapping[str, Any]] = ()
    version: int = VERSION

    def encoded(self) -> bytes:
        """As JSON."""
        fields: dict[str, Any] = {
            name: getattr(self, name) for name in self.__slots__ if name not in ("bodies", "objects")
        }
        fields["objects"] = [{"first": first, "last": last} for first, last in self.objects]
        bodies = [{name: getattr(body, name) for name in body.__slots__} for body in self.bodies]
        told = {"format": FORMAT, **fields, "bodies": bodies}
        return json.dumps(told, allow_nan=False, indent=1).encode()

    @classmethod
    def of(cls, text: bytes, path: Path) -> MotionHeader:
        """From JSON.

        Raises
        ------
        SplatFormatError, RecordingError
            Where it is damaged, or of a newer version.
        """
        meta = parse_meta(text, HEADER, path)
        if meta.entries.get("format") != FORMAT:
            raise RecordingError(f"{path}: {HEADER} is of no moving splat")
        if meta.integer("version") > VERSION:
            raise RecordingError(
                f"{path}: is a moving splat of version {meta.integer('version')}, this GASP reads up to {VERSION}: "
                "update GASP"
            )
        bodies = meta.objects("bodies")
        colliders = meta.objects("colliders") if meta.entries.get("colliders") else ()
        header = cls(
            frames=_within(meta, "frames", 1, _MOST_FRAMES),
            frames_a_block=_within(meta, "frames_a_block", 1, _MOST_FRAMES_A_BLOCK),
            frame_rate=_positive(meta, "frame_rate"),
            origin=tuple(meta.numbers("origin", 3)),
            quantum=_positive(meta, "quantum"),
            largest_error=meta.number("largest_error"),
            # Below 1 as in `recorded_maps`.
            alpha=None if meta.entries.get("alpha") is None else max(_positive(meta, "alpha"), 1.0),
            bodies=tuple(_body(body) for body in bodies[:_MOST_BODIES]),
            objects=_objects(meta),
            camera=None if meta.entries.get("camera") is None else meta.inner("camera").entries,
            colliders=tuple(one.entries for one in colliders),
            version=meta.integer("version"),
        )
        end = 0
        for body in header.bodies:
            if not end <= body.first < body.last or len(bodies) > _MOST_BODIES:
                raise meta.wrong("bodies", "bodies that lie one behind the other")
            end = body.last
        return header


def _body(meta: Meta) -> BodyHeader:
    kind, name = (meta.entries.get(key) for key in ("kind", "name"))
    grains = _within(meta, "grains", 0, _MOST_GRAINS) if meta.entries.get("grains") and kind == "volume" else 0
    if kind not in (*KINDS, _FREE) or not isinstance(name, str):
        raise meta.wrong("kind", f"one of {', '.join((*KINDS, _FREE))}, and a name")
    return BodyHeader(
        name=name,
        first=meta.integer("first"),
        last=meta.integer("last"),
        kind=kind,
        points=_within(meta, "points", 0 if kind == _FREE else 1, 1 << 31),
        spacing=meta.number("spacing"),
        centre=tuple(meta.numbers("centre", 3)),
        grains=grains,
        grain_scale=_positive(meta, "grain_scale") if grains else 0.0,
    )


def _objects(meta: Meta) -> tuple[tuple[int, int], ...]:
    found = (
        [(one.integer("first"), one.integer("last")) for one in meta.objects("objects")]
        if "objects" in meta.entries
        else []
    )
    ends = [0, *(end for rows in found for end in rows)]
    if ends != sorted(ends) or len(found) > _MOST_OBJECTS:
        raise meta.wrong("objects", "objects that lie one behind the other")
    return tuple(found)


def _within(meta: Meta, name: str, low: int, high: int) -> int:
    value = meta.integer(name)
    if not low <= value <= high:
        raise meta.wrong(name, f"a number from {low} to {high:,}")
    return value


def _positive(meta: Meta, name: str) -> float:
    value = meta.number(name)
    if not value > 0 or math.isinf(value):
        raise meta.wrong(name, "a positive number")
    return value
