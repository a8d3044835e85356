"""Where things are in a recording, and how they are written.

A recording is a folder, a Zarr (version 3) hierarchy throughout:

| node | what |
|---|---|
| ``/`` | attributes: the `Header`, with length and checksum of every file that is written once |
| ``reference/means``, ``quaternions``, ``scales``, ``opacities``, ``harmonics`` | the drawn scene at rest |
| ``reference/moving`` | (N,) bool, which Gaussians are simulated |
| ``reference/points`` | (P, 3) float64, the engine's points at the start, edges magnified [m] |
| ``bodies/<i>/...`` | how the body's points carry its Gaussians, arrays of its `TransferOperator` |
| ``frames/displacements`` | (T, P, 3) float32, from the start, less the body's mean displacement; a chunk a frame [m] |
| ``frames/velocities`` | the same for velocities, where asked for [m/s] |
| ``frames/drifts`` | (T, D, 3) float32, how far simplices have moved by themselves, see `gasp_core.dynamics` [m] |
| ``bodies/<i>/unmoved`` | (N, V, 3) float64, instead, what the formula in the scene is applied to [m] |
| ``commits/<frame>`` | attributes: the `Commit`, and what its chunks are. A frame exists once this does |
| ``checkpoints/<frame>`` | the engine's state, bytes of an ``.npz``, and their check as an attribute; at most two |
| ``status`` | attributes: state, reason, frames wanted; the scene as well, where it was gone on with and has changed |

Header, commits, status and the metadata of checkpoints and of arrays of frames end with their own checksum. So every
file is either checked by what commits it or by itself; `gasp_core.recording.files` says what a checksum is worth.
Every chunk is a file, all zeros too: one that is missing is damage. Recordings that were begun before version 6 have
none of this, and are gone on with as they were begun.

Displacements less their mean keep the shape of a small edge however far the body flew: at 1e4 m a float32 knows
positions to a millimetre.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.processes.scratch import MARK
from gasp_core.recording.files import FileCheck, short
from gasp_core.recording.migrations import VERSION, migrated

__all__ = [
    "CHECKED_FROM",
    "FILES",
    "FORMAT",
    "BodyEntry",
    "Commit",
    "EngineRecord",
    "Header",
    "ObjectEntry",
    "commit_attributes",
    "commit_key",
]

FORMAT = "gasp-recording"
CHECKED_FROM = 6
"""The first version whose files have checksums."""

FILES = re.compile(rf"(zarr\.json|c(\.[0-9]+)*|[0-9]+(\.[0-9]+)*)(\.part|\.[0-9a-f]{{32}}\.partial)?|{re.escape(MARK)}")
"""Names of all files that recordings of any version have, and of what killed runs leave of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineRecord:
    """Which engine made the frames, and how it was set; a run goes on only with the same.

    `options` are those that were not at their defaults, as JSON values.
    """

    name: str
    version: str
    device: str
    precision: str
    seed: int
    options: Mapping[str, Any]
    checkpoints: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectEntry:
    """An object of the scene: its rows of the drawn Gaussians, its source and what was set aside.

    `placement` has the fields of `Placement`: world = scale * rotation @ file + translation. None in recordings made
    before that was kept.
    """

    name: str
    first: int
    last: int
    splat_digest: str
    set_aside: Mapping[str, Any]
    placement: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyEntry:
    """What is simulated of an object: its row in `Header.objects`, vertices a simplex, rows of the points, carrier.

    `drifts`: whether it moves by itself as well, see `gasp_core.dynamics`. `motion`: as the scene has it, where that is
    a formula.
    """

    item: int
    vertices: int
    first: int
    last: int
    carrier: str
    drifts: bool
    motion: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """All about a recording that never changes while it is made.

    Parameters
    ----------
    gasp_version
        That wrote it.
    scene
        As TOML, as the run was begun with; no frame needs it to be read.
    scene_digest
        SHA-256 of what decides the frames, `gasp_core.scene.digest`.
    points_digest
        SHA-256 of the engine's points at the start.
    frame_rate
        [1/s].
    spacing
        Of the engine's grid [m].
    maps
        As `gasp_core.recording.map_record` keeps them.
    objects, bodies
        What the rows are.
    notes
        Sentences for the user: what was set aside, and the like.
    engine
        What made it.
    files
        Length [bytes] and checksum of every file that is written once, by its path. Empty before version 6.
    """

    gasp_version: str
    scene: str
    scene_digest: str
    points_digest: str
    frame_rate: float
    spacing: float
    maps: Mapping[str, Any]
    objects: tuple[ObjectEntry, ...]
    bodies: tuple[BodyEntry, ...]
    notes: tuple[str, ...]
    engine: EngineRecord
    files: Mapping[str, Sequence[int]] = field(default_factory=dict)

    def attributes(self) -> dict[str, Any]:
        """As JSON values."""
        return {"format": FORMAT, "version": VERSION, **dataclasses.asdict(self)}

    @classmethod
    def of(cls, attributes: Mapping[str, Any], path: Path) -> Header:
        """From JSON values.

        Raises
        ------
        RecordingError
            Where they are not of a recording, or of a newer version.
        """
        if attributes.get("format") != FORMAT:
            raise RecordingError(
                f"{path}: is no recording (lacks the mark {FORMAT}): name a folder that gasp run wrote"
            )
        version = attributes.get("version")
        if type(version) is not int or not 1 <= version <= VERSION:
            raise RecordingError(
                f"{path}: is a recording of version {ascii(version)[:20]}, this GASP reads up to {VERSION}: update GASP"
            )
        try:
            today = migrated(dict(attributes))
            values = {field.name: today[field.name] for field in dataclasses.fields(cls)}
            values["objects"] = tuple(ObjectEntry(**entry) for entry in values["objects"])
            values["bodies"] = tuple(BodyEntry(**entry) for entry in values["bodies"])
            values["notes"] = tuple(values["notes"])
            values["engine"] = EngineRecord(**values["engine"])
            if version >= CHECKED_FROM and not values["files"]:
                raise ValueError("it does not know its files")
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
            raise RecordingError(f"{path}: the header of the recording is damaged ({short(error)})") from None
        return cls(**values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Commit:
    """A finished frame.

    Parameters
    ----------
    frame, time
        Number and simulated time [s].
    chunks
        What every chunk file is, by its path in the recording. Before version 6 a length alone, and 0 for a chunk of
        zeros, which had no file.
    body_displacements
        Mean displacement [m] of each body, float64.
    degenerate
        For each body, rows without a frame of their own and the last frame in which they had one.
    diagnostics
        What is known of the step that led here.
    """

    frame: int
    time: float
    chunks: Mapping[str, FileCheck]
    body_displacements: tuple[tuple[float, float, float], ...]
    degenerate: tuple[tuple[tuple[int, int], ...], ...]
    diagnostics: Mapping[str, Any]


def commit_key(frame: int) -> str:
    """File of a frame's commit, within the recording."""
    return f"commits/{frame:08d}/zarr.json"


def commit_attributes(commit: Commit, header: Header) -> dict[str, Any]:
    """A commit as JSON values, as recordings with that header have it."""
    chunks = {key: [check.size, check.checksum] if header.files else check.size for key, check in commit.chunks.items()}
    fields = {item.name: getattr(commit, item.name) for item in dataclasses.fields(Commit)}
    return {**fields, "chunks": chunks}
