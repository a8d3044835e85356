"""From a recording to a moving splat: quantised, foretold from frame to frame, and held against what was recorded."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.errors import RecordingError
from gasp_core.io.atomic import replacing
from gasp_core.io.sog import read_sog_zip
from gasp_core.io.sog_writing import sog_members, write_members
from gasp_core.moving.body_writing import BodyFrame, BodyWriter
from gasp_core.moving.carriers import KINDS, files_of
from gasp_core.moving.grains import PackedGrains
from gasp_core.moving.header import COLLIDERS, FOLDER, HEADER, BodyHeader, MotionHeader
from gasp_core.moving.html import write_page
from gasp_core.moving.reading import block_name, body_of
from gasp_core.moving.solids import entries_of
from gasp_core.recording.drawn import DrawnFrames
from gasp_core.recording.map_record import map_record, recorded_maps
from gasp_core.recording.reader import Recording
from gasp_core.reduction.bodies import Body
from gasp_core.reduction.grains import Grains
from gasp_core.reduction.morton import along_a_curve
from gasp_core.scene.placement import Placement, place, upright

__all__ = ["DEFAULT_ERROR", "Packed", "pack"]

Array = NDArray[Any]

DEFAULT_ERROR = 1e-4
"""Of the diagonal: a tenth of a millimetre of a metre."""
_FRAMES_A_BLOCK = 24
_QUANTUM = 1.0
"""Of the error allowed: rounding alone then takes up to sqrt(3) / 2 of it."""
_COARSEST = 1e-3
"""Of the diagonal: coarser steps turn what points carry by so much that corrections take more than steps save."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """What has been written.

    Parameters
    ----------
    size
        Of the splat and its motion [bytes]; a page takes a third more.
    motion
        What of it is the motion, without the splat and the carriers [bytes].
    frames
        How many.
    largest_error
        How far any mean in any frame is from where it was recorded [m].
    allowed_error
        How far it might be [m].
    """

    size: int
    motion: int
    frames: int
    largest_error: float
    allowed_error: float


def pack(
    recording: Recording,
    path: str | Path,
    *,
    error: float = DEFAULT_ERROR,
    camera: Mapping[str, Any] | None = None,
    colliders: Sequence[Collider] = (),
    progress: Callable[[], None] | None = None,
) -> Packed:
    """Write a recording as a moving splat, a file that one can send; as a page that plays it where its name ends so.

    Parameters
    ----------
    recording
        With at least one frame.
    path
        Where to; an existing file is replaced. What ends in ``.html`` is a page that plays it, in any browser that has
        WebGL 2, without a network.
    error
        How far any mean of any frame may be from where it was recorded, as a share of the diagonal of what moves.
    camera
        Where players begin: see docs/moving_splats.md.
    colliders
        What players draw besides; those of files are read.
    progress
        Called after every frame.

    Raises
    ------
    RecordingError, SplatFormatError, SceneError
        Where the recording or the file of a collider is damaged or empty, the error asked for cannot be kept, or the
        disk refuses.
    """
    path = Path(path)
    # Read once: a run that is still going has more in the next moment.
    count = recording.frame_count
    if count == 0:
        raise RecordingError(f'{recording.path}: holds no frame yet: go on with "gasp run --resume"')
    if not error > 0:
        raise RecordingError(f"the error allowed is {error:g}: it must be above 0")
    try:
        entries, solids = entries_of(colliders, np.arange(count) / recording.header.frame_rate)
    except ValueError as failure:
        raise RecordingError(f"{path}: {failure}") from failure
    refusal = f"{path}: an error of {error:g} of the diagonal cannot be kept: allow more"
    try:
        source = _Source.of(recording, count, error)
        blocks, largest = _frames(recording, source, progress, count)
    except ValueError as failure:
        raise RecordingError(f"{refusal} ({failure})") from failure
    if largest > source.allowed:
        raise RecordingError(f"{refusal}, {largest / source.diagonal:.1g} at least")
    header = MotionHeader(
        frames=count,
        frames_a_block=_FRAMES_A_BLOCK,
        frame_rate=recording.header.frame_rate,
        origin=tuple(source.origin.tolist()),
        quantum=source.quantum,
        largest_error=largest,
        alpha=None if _bounded(recording) else map_record(recorded_maps(recording.header.maps))["alpha"],
        bodies=tuple(body.header for body in source.bodies),
        objects=source.objects,
        camera=camera,
        colliders=entries,
    )
    files = {
        f"{FOLDER}{number}/{name}": content
        for number, body in enumerate(source.bodies)
        for name, content in body.files.items()
    }
    files |= {COLLIDERS + name: content for name, content in solids.items()}
    packed = {HEADER: header.encoded(), **files, **{block_name(k): block for k, block in enumerate(blocks)}}
    stream = io.BytesIO()
    write_members(stream, source.members, packed)
    if path.suffix.lower() == ".html":
        write_page(path, stream.getvalue(), path.stem)
    else:
        with replacing(path) as target:
            target.write(stream.getvalue())
    with zipfile.ZipFile(stream) as archive:
        motion = sum(archive.getinfo(block_name(number)).compress_size for number in range(len(blocks)))
    return Packed(
        size=len(stream.getvalue()),
        motion=motion,
        frames=count,
        largest_error=largest,
        allowed_error=source.allowed,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _PackedBody:
    """A body as the file has it.

    Parameters
    ----------
    header, files
        What a reader makes it from.
    writer
        A new one, of its frames from the first on.
    """

    header: BodyHeader
    files: dict[str, bytes]
    writer: Callable[[], BodyWriter]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    """What of a recording a moving splat holds before its first frame.

    Parameters
    ----------
    members
        Of the .sog.
    origin : (3,) [m]
    diagonal [m]
        Of all that moves, at rest.
    quantum, allowed
        Of whole numbers, and how far means may be off [m].
    bodies
        That move.
    objects
        Of every object its rows of the file, the last not among them.
    """

    members: Mapping[str, bytes]
    origin: Array
    diagonal: float
    quantum: float
    allowed: float
    bodies: tuple[_PackedBody, ...]
    objects: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, recording: Recording, count: int, error: float) -> _Source:
        reference = recording.reference
        order, starts = _order(recording)
        means = reference.means[order]
        low, high = means.min(axis=0), means.max(axis=0)
        origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]], dtype=np.float64)
        turn = upright("-y")
        away = Placement(rotation=turn.T, scale=1.0, translation=-turn.T @ origin)
        members = sog_members(place(reference.select(order), away))
        stream = io.BytesIO()
        write_members(stream, members)
        splat, _ = read_sog_zip(stream.getvalue(), recording.path)
        held = place(splat, Placement(rotation=turn, scale=1.0, translation=origin))
        rows = np.concatenate([body.rows for body in recording.bodies])
        extent = float(np.linalg.norm(np.ptp(reference.means[rows], axis=0)))
        # A single Gaussian has no extent but its own.
        diagonal = extent or float(reference.scales[rows].max())
        quantum, allowed = _QUANTUM * min(error, _COARSEST) * diagonal, error * diagonal
        flowing = {body.name: grains for body, grains in DrawnFrames(recording).grains}

        def packed(body: Body, first: int, kind: str) -> _PackedBody:
            grains = flowing.get(body.name)
            header = _header(body, first, kind, grains)
            rows = np.searchsorted(body.rows, order[header.first : header.last])
            files = files_of(body.carrier, rows) if kind in KINDS else {}  # pyright: ignore[reportArgumentType]
            if grains is not None:
                files |= PackedGrains.files_of(grains)
            moving = body_of(header, files, held)

            def writer() -> BodyWriter:
                return BodyWriter(
                    moving=moving,
                    rows=rows,
                    held=held.select(moving.rows),
                    recorded=reference.select(body.rows[rows]),
                    quantum=quantum,
                    allowed=allowed,
                    grains=grains,
                    start=recording.start_points[body.points],
                )

            return _PackedBody(header=header, files=files, writer=writer)

        bodies: list[_PackedBody] = []
        for number, (body, entry) in enumerate(zip(recording.bodies, recording.header.bodies)):
            choices = [packed(body, starts[entry.item], kind) for kind in _kinds(body, entry.drifts)]
            bodies.append(_shortest(choices, number, recording, count))
        return cls(
            members=members,
            origin=origin,
            diagonal=diagonal,
            quantum=quantum,
            allowed=allowed,
            bodies=tuple(bodies),
            objects=tuple(pairwise([*starts, len(order)])),
        )


def _order(recording: Recording) -> tuple[Array, list[int]]:
    """Rows as they lie in the file, and where every object begins there."""
    reference, moving = recording.reference, recording.moving
    parts: list[Array] = []
    starts: list[int] = []
    end = 0
    for item in recording.header.objects:
        starts.append(end)
        rows = np.arange(item.first, item.last)
        for chosen in (rows[moving[rows]], rows[~moving[rows]]):
            if len(chosen):
                parts.append(chosen[along_a_curve(reference.means[chosen].astype(np.float64))])
                end += len(chosen)
    return np.concatenate(parts), starts


def _kinds(body: Body, drifts: bool) -> tuple[str, ...]:
    """How it may be packed: on points, as far as these say where it goes, or each Gaussian by itself.

    What psi carries on is not where points alone would take it. Where it drives, it leads the points as well, and how
    near to their maps it keeps depends on psi.
    """
    if body.carrier.kind not in KINDS or (drifts and body.driven is None):
        return ("free",)
    return (body.carrier.kind, "free") if drifts else (body.carrier.kind,)


def _header(body: Body, first: int, kind: str, grains: Grains | None) -> BodyHeader:
    carried = kind != "free"
    return BodyHeader(
        name=body.name,
        first=first,
        last=first + len(body.rows),
        kind=kind,
        points=body.points.stop - body.points.start if carried else 0,
        spacing=float(getattr(body.carrier, "spacing", 0.0)) if carried else 0.0,
        centre=tuple(body.block.centre.tolist()),
        grains=0 if grains is None else grains.offsets.shape[1],
        grain_scale=0.0 if grains is None else grains.scale,
    )


def _frames(
    recording: Recording, source: _Source, progress: Callable[[], None] | None, count: int
) -> tuple[list[bytes], float]:
    """The blocks of so many frames, and the largest error [m]."""
    writers = [body.writer() for body in source.bodies]
    blocks: list[bytearray] = []
    for frame in range(count):
        if frame % _FRAMES_A_BLOCK == 0:
            blocks.append(bytearray())
        for writer, found in zip(writers, _recorded(recording, frame)):
            blocks[-1] += writer.write(found)
        if progress is not None:
            progress()
    return [bytes(block) for block in blocks], max((writer.largest for writer in writers), default=0.0)


def _recorded(recording: Recording, frame: int) -> list[BodyFrame]:
    """A frame of every body."""
    relative, shifts = recording.displacements(frame)
    simplices = recording.bounded_simplices(frame) if _bounded(recording) else recording.simplices(frame)
    return [
        BodyFrame(simplices=simplices[body.name], displacements=relative[body.points], shift=shift)
        for body, shift in zip(recording.bodies, shifts)
    ]


def _bounded(recording: Recording) -> bool:
    """Whether simplices are bounded here: whoever draws would bound what psi stretches as well."""
    return any(body.drifts for body in recording.header.bodies)


def _shortest(choices: Sequence[_PackedBody], number: int, recording: Recording, count: int) -> _PackedBody:
    """The one that takes least room in a few frames of body `number`: three in a row, foretold by each other, at
    a quarter, at half and at the end of the motion."""
    if len(choices) == 1:
        return choices[0]
    rows = [range(max(end - 3, 0), end) for end in sorted({max(count // 4, 1), max(count // 2, 1), count})]
    sampled = [[_recorded(recording, frame)[number] for frame in row] for row in rows]

    def size(body: _PackedBody) -> int:
        taken = sum(map(len, body.files.values()))
        for frames in sampled:
            writer = body.writer()
            written = [writer.write(frame) for frame in frames]
            taken += len(zlib.compress(written[-1])) * count // len(sampled)
        return taken

    return min(choices, key=size)
