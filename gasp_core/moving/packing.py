"""From a recording to a moving splat: quantised, foretold from frame to frame, and held against what was recorded."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.errors import RecordingError
from gasp_core.gaussians import Gaussians
from gasp_core.io.atomic import replacing
from gasp_core.io.sog import read_sog_zip
from gasp_core.io.sog_writing import sog_members, write_members
from gasp_core.moving.bodies import Corrections, FreeBody, MovingBody
from gasp_core.moving.carriers import KINDS, files_of
from gasp_core.moving.frames import FrameWriter, encoded_corrections
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
    source = _Source.of(recording)
    allowed = error * source.diagonal
    quantum = _QUANTUM * allowed
    try:
        entries, solids = entries_of(colliders, np.arange(count) / recording.header.frame_rate)
    except ValueError as failure:
        raise RecordingError(f"{path}: {failure}") from failure
    refusal = f"{path}: an error of {error:g} of the diagonal cannot be kept: allow more"
    try:
        blocks, largest = _frames(source, count, quantum, allowed, progress)
    except ValueError as failure:
        raise RecordingError(f"{refusal} ({failure})") from failure
    if largest > allowed:
        raise RecordingError(f"{refusal}, {largest / source.diagonal:.1g} at least")
    header = MotionHeader(
        frames=count,
        frames_a_block=_FRAMES_A_BLOCK,
        frame_rate=recording.header.frame_rate,
        origin=tuple(source.origin.tolist()),
        quantum=quantum,
        largest_error=largest,
        alpha=None if source.bounded else map_record(recorded_maps(recording.header.maps))["alpha"],
        bodies=source.headers,
        objects=source.objects,
        camera=camera,
        colliders=entries,
    )
    files = {
        f"{FOLDER}{number}/{name}": content
        for number, carrier in enumerate(source.files)
        for name, content in carrier.items()
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
        allowed_error=allowed,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    """A recording, and its splat as whoever reads the file has it.

    Parameters
    ----------
    order : (N,)
        Rows of the recording as they lie in the file: object by object, what moves of it first, near by near.
    members
        Of the .sog.
    held
        The splat that it holds, in the world.
    origin : (3,) [m]
    diagonal [m]
        Of all that moves, at rest.
    flowing
        By the names of bodies that may flow, what they come apart into.
    headers, files, moving
        Of every body.
    objects
        Of every object its rows of the file, the last not among them.
    """

    recording: Recording
    order: Array
    members: Mapping[str, bytes]
    held: Gaussians
    origin: Array
    diagonal: float
    flowing: Mapping[str, Grains]
    headers: tuple[BodyHeader, ...]
    files: tuple[dict[str, bytes], ...]
    moving: tuple[MovingBody, ...]
    objects: tuple[tuple[int, int], ...]

    @property
    def bounded(self) -> bool:
        """Whether simplices are bounded here: whoever draws would bound what psi stretches as well."""
        return any(body.drifts for body in self.recording.header.bodies)

    @classmethod
    def of(cls, recording: Recording) -> _Source:
        reference, bodies = recording.reference, recording.bodies
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
        flowing = {body.name: grains for body, grains in DrawnFrames(recording).grains}
        headers, files, moving = [], [], []
        for body, entry in zip(bodies, recording.header.bodies):
            grains = flowing.get(body.name)
            header = _header(body, starts[entry.item], entry.drifts, grains)
            rows = np.searchsorted(body.rows, order[header.first : header.last])
            carrier = body.carrier
            files.append(files_of(carrier, rows) if header.kind in KINDS else {})  # pyright: ignore[reportArgumentType]
            if grains is not None:
                files[-1] |= PackedGrains.files_of(grains)
            headers.append(header)
            moving.append(body_of(header, files[-1], held))
        rows = np.concatenate([body.rows for body in bodies])
        extent = float(np.linalg.norm(np.ptp(reference.means[rows], axis=0)))
        return cls(
            recording=recording,
            order=order,
            members=members,
            held=held,
            origin=origin,
            # A single Gaussian has no extent but its own.
            diagonal=extent or float(reference.scales[rows].max()),
            flowing=flowing,
            headers=tuple(headers),
            objects=tuple(pairwise([*starts, len(order)])),
            files=tuple(files),
            moving=tuple(moving),
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


def _header(body: Body, first: int, drifts: bool, grains: Grains | None) -> BodyHeader:
    # What moves by itself as well is not where points alone would take it.
    kind = body.carrier.kind if body.carrier.kind in KINDS and not drifts else "free"
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
    source: _Source, count: int, quantum: float, allowed: float, progress: Callable[[], None] | None
) -> tuple[list[bytes], float]:
    """The blocks of so many frames, and the largest error [m]."""
    recording = source.recording
    writers = [FrameWriter() for _ in source.moving]
    flows = {name: FrameWriter() for name in source.flowing}
    blocks: list[bytearray] = []
    largest = 0.0
    for frame in range(count):
        if frame % _FRAMES_A_BLOCK == 0:
            blocks.append(bytearray())
        relative, shifts = recording.displacements(frame)
        recorded = recording.bounded_simplices(frame) if source.bounded else recording.simplices(frame)
        for body, moving, header, writer, shift in zip(
            recording.bodies, source.moving, source.headers, writers, shifts
        ):
            rows = np.searchsorted(body.rows, source.order[header.first : header.last])
            simplices = recorded[body.name][rows]
            rest = recording.reference.select(body.rows[rows])
            if isinstance(moving, FreeBody):
                numbers = moving.numbers_of(simplices, rest, shift, quantum)
            else:
                numbers = np.round(relative[body.points] / quantum).astype(np.int64)
            held = source.held.select(moving.rows)
            found = moving.simplices(numbers, shift, quantum)
            corrections = Corrections.of(found, simplices, held, rest, quantum, allowed)
            blocks[-1] += shift.astype("<f8").tobytes() + writer.write(numbers) + encoded_corrections(corrections)
            if body.name in flows:
                places = recording.start_points[body.points] + relative[body.points] + shift
                numbers = PackedGrains.numbers_of(source.flowing[body.name], places)
                blocks[-1] += flows[body.name].write(numbers)
            found = corrections.applied(found, held, quantum)
            largest = max(largest, float(np.linalg.norm(found[:, 0] - simplices[:, 0], axis=1).max()))
        if progress is not None:
            progress()
    return [bytes(block) for block in blocks], largest
