"""`MovingSplat`: reads what `gasp pack` wrote."""

from __future__ import annotations

import math
import struct
import zipfile
import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gasp_core.contract import Collider
from gasp_core.errors import RecordingError, SplatFormatError
from gasp_core.games import matter_rotations
from gasp_core.gaussians import Gaussians
from gasp_core.harmonics import turn_coefficients
from gasp_core.io.memory_limit import refuse_unread
from gasp_core.io.sog import read_sog_zip
from gasp_core.moving.bodies import CarriedBody, Corrections, FreeBody, MovingBody, at_rest
from gasp_core.moving.carriers import carrier_labels, carrier_of
from gasp_core.moving.frames import CorrectionReader, FrameReader
from gasp_core.moving.grains import GrainState, PackedGrains
from gasp_core.moving.header import COLLIDERS, FOLDER, HEADER, BodyHeader, MotionHeader
from gasp_core.moving.solids import solids_of
from gasp_core.recording.drawn import Drawn
from gasp_core.reduction.bodies import shapes
from gasp_core.reduction.point_frames import PointFrames
from gasp_core.render_input import RenderInput
from gasp_core.scene.placement import Placement, place, upright
from gasp_core.scene.settings import MapChoice

__all__ = ["MovingSplat", "block_name", "body_of"]

Array = NDArray[Any]

_LONGEST_HEADER = 1 << 22
_WIDEST = 4 * 12 + 1
"""Bytes that a row of a table or of a frame may take, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _BodyFrame:
    """Of a body in a frame: whole numbers, the mean displacement (3,) [m], corrections, and how far it has flowed."""

    numbers: Array
    shift: Array
    corrections: Corrections
    flow: Array | None


class MovingSplat:
    """A splat and its motion, from one file; use `MovingSplat.open`.

    All that it gives is in metres, +z up.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile, header: MotionHeader, splat: Gaussians) -> None:
        self.path = path
        self.header = header
        self._archive = archive
        placement = Placement(rotation=upright("-y"), scale=1.0, translation=np.array(header.origin))
        self.reference = place(splat, placement)
        found = [self._body(number, body) for number, body in enumerate(header.bodies)]
        self._bodies, self._grains = [body for body, _ in found], [grains for _, grains in found]
        self._held = [self.reference.select(body.rows) for body in self._bodies]
        self.colliders: tuple[Collider, ...] = self._solids()
        self._readers: list[tuple[FrameReader, CorrectionReader, FrameReader | None]] = []
        self._block = memoryview(b"")
        self._next = 0
        self._at: tuple[int, list[_BodyFrame]] = (-1, [])

    @classmethod
    def open(cls, path: str | Path) -> MovingSplat:
        """Open a moving splat.

        Raises
        ------
        SplatFormatError, RecordingError
            Where it is none, is damaged or cut off, or of a newer version.
        """
        path = Path(path)
        try:
            refuse_unread(path, path.stat().st_size)
            data = path.read_bytes()
            archive = zipfile.ZipFile(BytesIO(data))
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror or error}: check the path") from error
        # What zipfile raises of bytes that nobody vouches for; the third where they ask for a later version of it.
        except (zipfile.BadZipFile, struct.error, NotImplementedError, ValueError) as error:
            raise RecordingError(f"{path}: is no moving splat, or cut off: pack or fetch it again") from error
        if HEADER not in archive.namelist():
            raise RecordingError(f"{path}: has no {HEADER}: it is no moving splat; gasp pack makes one of a run")
        splat, _ = read_sog_zip(data, path)
        header = MotionHeader.of(_fetch(archive, HEADER, _LONGEST_HEADER, path), path)
        if max(header.bodies[-1].last, *(last for _, last in header.objects), 0) > len(splat):
            raise RecordingError(f"{path}: moves Gaussians that it does not have: {HEADER} is damaged")
        return cls(path, archive, header, splat)

    def __len__(self) -> int:
        return self.header.frames

    @property
    def times(self) -> Array:
        """Of the frames [s], (T,)."""
        return np.arange(len(self)) / self.header.frame_rate

    def gaussians(self, frame: int) -> Gaussians:
        """All Gaussians at a frame, harmonics turned with the matter."""
        moved, turns = self._moved(frame)
        return moved if turns is None else moved.with_(harmonics=turn_coefficients(moved.harmonics, turns))

    def splats(self, frame: int) -> RenderInput:
        """The same for drawing: harmonics as at rest, and the turns of the matter beside them."""
        moved, turns = self._moved(frame)
        return RenderInput(
            means=moved.means,
            opacities=moved.opacities,
            harmonics=moved.harmonics,
            quaternions=moved.quaternions,
            scales=moved.scales,
            turns=turns,
        )

    def simplices(self, frame: int) -> list[tuple[Array, Array]]:
        """For each body its rows (N,) of the splat, and the mean and the ends of the axes of each, (N, 4, 3) [m].

        Frames are foretold by those before them: one after the other is fast, going back begins at the first again.

        Raises
        ------
        IndexError
            Where there is no such frame.
        RecordingError
            Where it is damaged.
        """
        if not 0 <= frame < len(self):
            raise IndexError(f"{self.path}: has frames 0 to {len(self) - 1}, not {frame}")
        if frame < self._next - 1:
            self._next = 0
        if self._next == 0:
            self._readers = [
                (
                    FrameReader(body.numbers),
                    CorrectionReader(len(body.rows), self.header.version),
                    None if grains is None else FrameReader((body.numbers[0], 2)),
                )
                for body, grains in zip(self._bodies, self._grains)
            ]
        while self._next <= frame:
            self._at = (self._next, self._read(self._next))
            self._next += 1
        quantum = self.header.quantum
        return [
            (body.rows, own.corrections.applied(body.simplices(own.numbers, own.shift, quantum), held, quantum))
            for body, held, own in zip(self._bodies, self._held, self._at[1])
        ]

    def drawn(self, frame: int) -> RenderInput:
        """As `splats`, with what has flowed as grains, which come behind the Gaussians of the file."""
        return self._with_grains(frame)[0]

    @property
    def most_grains(self) -> int:
        """How many grains a frame may have."""
        return sum(grains.most for grains in self._grains if grains is not None)

    def at(self, frame: int) -> Drawn:
        """What is drawn in a frame, and the Gaussians whose colours it has: of a grain the one nearest to its point."""
        drawn, flowed = self._with_grains(frame)
        grains = [self._bodies[number].rows[self._nearest[number][state.points]] for number, state in flowed.items()]
        return Drawn(splats=drawn, sources=np.concatenate([np.arange(len(self.reference)), *grains]))

    def _with_grains(self, frame: int) -> tuple[RenderInput, dict[int, GrainState]]:
        """What is drawn, and the grains behind the Gaussians of the file, by the numbers of their bodies."""
        splats = self.splats(frame)
        opacities = splats.opacities.astype(np.float64)
        states: dict[int, GrainState] = {}
        for number, (body, grains, own) in enumerate(zip(self._bodies, self._grains, self._at[1])):
            if grains is None or own.flow is None:
                continue
            assert isinstance(body, CarriedBody)
            places = body.places(own.numbers, own.shift, self.header.quantum)
            try:
                state = grains.at(own.flow, places)
            except ValueError as error:
                raise RecordingError(f"{self.path}: frame {frame} is damaged: {error}") from error
            opacities[body.rows] *= state.left
            states[number] = state
        if not states:
            return splats, states
        drawn = replace(splats, opacities=opacities).with_round(
            np.concatenate([state.means for state in states.values()]),
            np.concatenate([state.scales for state in states.values()]),
            np.concatenate([state.opacities for state in states.values()]),
            np.concatenate([state.colours for state in states.values()]),
        )
        return drawn, states

    @cached_property
    def _nearest(self) -> list[Array]:
        """Of every body that may flow the Gaussian nearest to each of its points, at rest."""
        from scipy.spatial import KDTree

        found: list[Array] = []
        for body, grains in zip(self._bodies, self._grains):
            if grains is None:
                found.append(np.zeros(0, dtype=np.int64))
                continue
            assert isinstance(body, CarriedBody) and isinstance(body.carrier, PointFrames)
            tree: Any = KDTree(body.rest[:, 0])
            found.append(np.asarray(tree.query(body.carrier.points)[1]))
        return found

    def _moved(self, frame: int) -> tuple[Gaussians, Array | None]:
        means, quaternions, scales = (
            np.array(getattr(self.reference, name), dtype=np.float64) for name in ("means", "quaternions", "scales")
        )
        turns = np.tile(np.eye(3), (len(means), 1, 1)) if self.reference.sh_degree else None
        maps = MapChoice(alpha=math.inf if self.header.alpha is None else self.header.alpha)
        for rest, (rows, simplices) in zip(self._held, self.simplices(frame)):
            # About a place near them: the thinnest edges are lost in the digits of a place far away.
            near = simplices[:, 0].mean(axis=0)
            moved = shapes(simplices - near, rest, maps)
            means[rows] = moved.gaussians.means + near
            quaternions[rows], scales[rows] = moved.gaussians.quaternions, moved.gaussians.scales
            if turns is not None:
                turns[rows] = matter_rotations(moved.simplices, rest, moved.degenerate)
        return self.reference.with_(means=means, quaternions=quaternions, scales=scales), turns

    def _solids(self) -> tuple[Collider, ...]:
        def fetch(name: str, most: int) -> bytes:
            return _fetch(self._archive, COLLIDERS + name, most, self.path)

        try:
            return solids_of(self.header.colliders, fetch, self.times)
        except ValueError as error:
            raise RecordingError(f"{self.path}: {error}") from error

    def _body(self, number: int, header: BodyHeader) -> tuple[MovingBody, PackedGrains | None]:
        head = f"{FOLDER}{number}/"
        most = _WIDEST * (header.points * max(1, header.grains) + header.last - header.first) + 1024
        names = [name for name in self._archive.namelist() if name.startswith(head)]
        files = {name.removeprefix(head): _fetch(self._archive, name, most, self.path) for name in names}
        try:
            return body_of(header, files, self.reference), _grains_of(header, files)
        except (KeyError, ValueError, IndexError) as error:
            told = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            raise RecordingError(f"{self.path}: what carries {header.name!r} is damaged: {told}") from error

    def _read(self, frame: int) -> list[_BodyFrame]:
        """What there is of every body in the frame that comes next."""
        block, place = divmod(frame, self.header.frames_a_block)
        if place == 0:
            length = min(self.header.frames_a_block, len(self) - frame)
            most = sum(4 * (2 * math.prod(body.numbers) + 13 * len(body.rows)) + 96 for body in self._bodies)
            self._block = memoryview(_fetch(self._archive, block_name(block), most * length, self.path))
        found: list[_BodyFrame] = []
        try:
            for reader, corrected, flows in self._readers:
                if len(self._block) < 24:
                    raise ValueError("it is cut off")
                shift = np.frombuffer(self._block, "<f8", 3)
                numbers, self._block = reader.read(self._block[24:])
                if not np.isfinite(shift).all():
                    raise ValueError("a displacement is no number")
                corrections, self._block = corrected.read(self._block)
                flow = None
                if flows is not None:
                    flow, self._block = flows.read(self._block)
                found.append(_BodyFrame(numbers=numbers, shift=shift, corrections=corrections, flow=flow))
        except ValueError as error:
            raise RecordingError(f"{self.path}: frame {frame} is damaged: {error}") from error
        return found


def body_of(header: BodyHeader, files: dict[str, bytes], reference: Gaussians) -> MovingBody:
    """What is moved, from its files.

    Raises
    ------
    ValueError, KeyError, IndexError
        Where they are damaged.
    """
    rows = np.arange(header.first, header.last)
    gaussians = reference.select(rows)
    if header.kind == "free":
        return FreeBody.of(rows, gaussians)
    centre = np.array(header.centre)
    return CarriedBody(
        rows=rows,
        centre=centre,
        rest=at_rest(gaussians.with_(means=gaussians.means - centre)),
        points=header.points,
        carrier=carrier_of(header.kind, files, header.points, len(rows), header.spacing),
    )


def _grains_of(header: BodyHeader, files: dict[str, bytes]) -> PackedGrains | None:
    if not header.grains:
        return None
    rows = header.last - header.first
    return PackedGrains.of(
        files,
        points=header.points,
        count=header.grains,
        scale=header.grain_scale,
        spacing=header.spacing,
        labels=carrier_labels(files, header.points, rows),
    )


def block_name(number: int) -> str:
    """The file of some frames."""
    return f"{FOLDER}frames_{number:04d}"


def _fetch(archive: zipfile.ZipFile, name: str, most: int, path: Path) -> bytes:
    """A file of the zip, no longer than it may be."""
    try:
        with archive.open(name) as member:
            content = member.read(most + 1)
    except KeyError:
        raise RecordingError(f"{path}: has lost {name}: pack or fetch it again") from None
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path}: {name} cannot be unpacked: pack or fetch it again") from error
    if len(content) > most:
        raise SplatFormatError(f"{path}: {name} is longer than it can be: the file is damaged")
    return content
