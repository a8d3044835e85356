"""Recordings as mutants: damaged by accident, or forged with all checksums as they must be.

A mutant is one file, so that the harness can count, bound and keep it: what lies in the folder, packed. It tells
whether it was forged. What was only damaged must not give a Gaussian that is not the recorded one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import io
import itertools
import json
import os
import random
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from mutation import mutated

__all__ = ["RecordingSeed", "read_recording", "recording_seeds", "in_haste"]

Files = dict[str, bytes]

KEPT = Path(__file__).parents[1] / "recording_versions"
_TOLD = "mutant.json"
"""Beside a mutant's files, what is in the place of which, and whether its checksums are right."""
FRAMES = 6
"""Of the whole run; recordings that were cut short have four."""
_INSTEAD = ("link", "device", "pipe", "folder", "loop")
"""What may be in the place of a file."""
_VALUES = (0, 1, -1, 29, 30, 700, 5000, 2**31 - 1, -(2**31), 2**62, 1e-300, 1e300, 3e38, np.inf, -np.inf, np.nan, 0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSeed:
    """A good recording.

    Parameters
    ----------
    name
        Of its packed file; it says what it is of, see `_SCENES`.
    parts
        Its files, by their paths.
    """

    name: str
    parts: Mapping[str, bytes]

    def pack(self, parts: Mapping[str, bytes]) -> bytes:
        """As one file, not forged."""
        return _packed(parts, {}, forged=False)

    def mutant(self, others: list[bytes], chance: random.Random) -> bytes:
        """One to three things changed, and in half of the mutants all checksums made right again."""
        files, instead = dict(self.parts), dict[str, str]()
        forged = chance.random() < 0.5
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            _change(files, instead, forged, others, chance)
        if forged:
            _forge(files, self.parts, chance)
        return _packed(files, instead, forged=forged)


def _packed(files: Mapping[str, bytes], instead: Mapping[str, str], *, forged: bool) -> bytes:
    """As an archive, which is unpacked without taking memory that would be counted as the reader's."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as packed:
        for key, content in files.items():
            packed.writestr(zipfile.ZipInfo(key), content)
        packed.writestr(zipfile.ZipInfo(_TOLD), json.dumps({"forged": forged, "instead": dict(instead)}))
    return archive.getvalue()


# --- changes --------------------------------------------------------------------------------------------------------


def _change(files: Files, instead: dict[str, str], forged: bool, others: list[bytes], chance: random.Random) -> None:
    """Change one thing."""
    if not files:
        return
    # Folders of few files decide as much as those of many.
    folder = chance.choice(sorted({key.partition("/")[0] for key in files}))
    key = chance.choice([key for key in sorted(files) if key.partition("/")[0] == folder])
    match chance.randrange(12):
        case 0:
            del files[key]
        case 1:
            head = key.rpartition("/")[0]
            for inside in [other for other in files if head and other.startswith(f"{head}/")]:
                del files[inside]
        case 2:
            files[key] = chance.choice((b"", bytes(len(files[key])), files[key] + bytes(chance.choice((1, 4096)))))
        case 3:
            files[key] = files[key][: chance.randrange(len(files[key]) + 1)]
        case 4:
            other = chance.choice(sorted(files))
            files[key], files[other] = files[other], files[key]
        case 5:
            alike = [other for other in sorted(files) if other.rpartition("/")[2][:2] == key.rpartition("/")[2][:2]]
            files[key] = files[chance.choice(alike)]
        case 6:
            # A frame, commit or checkpoint of a number that there is not, or of another one's.
            number = chance.choice((0, 1, 2, 3, 4, 5, 7, 99_999_999))
            files[f"commits/{number:08d}/zarr.json"] = files[key]
        case 7:
            instead[key] = chance.choice(_INSTEAD)
        case 8 | 9 if forged and _is_chunk(key):
            files[key] = _other_values(files[key], _node_of(files, key), chance)
        case 8 | 9 if key.endswith("zarr.json"):
            files[key] = _other_metadata(files[key], chance)
        case _:
            files[key] = mutated(files[key], others, chance)


def _is_chunk(key: str) -> bool:
    return key.rpartition("/")[2].startswith("c.")


def _node_of(files: Files, key: str) -> Any:
    try:
        return json.loads(files[f"{key.rpartition('/')[0]}/zarr.json"])
    except (KeyError, ValueError):
        return None


def _other_values(content: bytes, node: Any, chance: random.Random) -> bytes:
    """A chunk of the same array with some of its values replaced."""
    from gasp_core.recording.arrays import ArrayNode, decoded, encoded

    try:
        values = decoded(content, ArrayNode.of(node))
    except (ValueError, AttributeError):
        return content
    flat = values.reshape(-1)
    if not len(flat):
        return content
    rows = [chance.randrange(len(flat)) for _ in range(chance.choice((1, 1, 5)))]
    with np.errstate(all="ignore"):
        flat[rows] = np.asarray(chance.choice(_VALUES)).astype(flat.dtype)
    if chance.random() < 0.1:
        values = values.astype(chance.choice(("<i4", "<i8", "<f8", "u1")))
    return encoded(values, chance.choice(("lz4", "zstd")), chance.choice(("shuffle", "noshuffle", "bitshuffle")))


def _other_metadata(content: bytes, chance: random.Random) -> bytes:
    """A node with one value, wherever in it, replaced by another or by none, and the grammar right."""
    try:
        node = json.loads(content)
    except ValueError:
        return content
    places = [*_places(node)]
    holder, key = chance.choice(places)
    match chance.randrange(8):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, list):
            holder.extend([holder[key]] * chance.choice((1, 3, 20_000)))
        case 1:
            holder[f"{key}2"] = holder[key]
        case 2:
            other, name = chance.choice(places)
            with contextlib.suppress(KeyError, IndexError):
                # A copy: what held itself could not be written.
                holder[key] = json.loads(json.dumps(other[name]))
        case 3 if isinstance(holder[key], (int, float)):
            holder[key] += chance.choice((-1, 1, 0.5, 1 << 20, -holder[key]))
        case _:
            odd: tuple[Any, ...] = (None, True, -1, 0, 1, 2.5, 1 << 31, 1 << 62, 10**400, 1e300, "", "x", "\n\x1b[1m")
            odd += ([], {}, [[]], [0], [1, 2, 3], {"a": 1}, "../../etc/passwd", "a" * 5000, [0] * 5000, "/dev/zero")
            holder[key] = chance.choice(odd)
    return json.dumps(node).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Everything within a JSON value, as what holds it and under which key."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])


def _forge(files: Files, before: Mapping[str, bytes], chance: random.Random) -> None:
    """Make the checksums of everything that was changed right again."""

    changed = {key for key in files if files[key] != before.get(key)}
    for key in sorted(changed):
        if _is_chunk(key) and chance.random() < 0.8:
            files[key] = _with_crc(files[key])
    for key in [key for key in sorted(files) if key.endswith("zarr.json")]:
        if key.startswith("checkpoints/"):
            retell = functools.partial(_retell, files=files, changed=changed, folder=key.rpartition("/")[0])
            _edit(files, key, changed, lambda node, retell=retell: retell(node["attributes"]["files"]))
        elif key.startswith("commits/"):
            _edit(files, key, changed, lambda node: _retell(node["attributes"]["chunks"], files, changed))
    for key in changed - {"zarr.json"}:
        files[key] = _sealed(files[key])
    _edit(files, "zarr.json", changed, lambda node: _retell(node["attributes"]["files"], files, changed))
    if "zarr.json" in changed:
        files["zarr.json"] = _sealed(files["zarr.json"])


def _edit(files: Files, key: str, changed: set[str], edit: Callable[[Any], object]) -> None:
    try:
        node = json.loads(files[key])
        edit(node)
        content = json.dumps(node).encode()
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError):
        return
    if content != files[key]:
        files[key] = content
        changed.add(key)


def _retell(told: dict[str, Any], files: Files, changed: set[str], folder: str = "") -> None:
    from gasp_core.recording.files import checksum

    for name in told:
        key = f"{folder}/{name}" if folder else name
        if key in changed and key in files:
            told[name] = [len(files[key]), checksum(files[key])]


def _with_crc(content: bytes) -> bytes:
    import google_crc32c

    return content[:-4] + int(google_crc32c.value(content[:-4])).to_bytes(4, "little")


def _sealed(content: bytes) -> bytes:
    """A node whose bytes end as a seal does, with the seal that belongs to them."""
    from gasp_core.recording.files import checksum

    if not content.endswith(b'"}}') or len(content) < 11:
        return content
    before = content[:-11]
    return before + f"{checksum(before):08x}".encode() + b'"}}'


# --- good recordings ------------------------------------------------------------------------------------------------


def _scene(name: str) -> Any:
    """The scene that a seed of that name is of."""
    if name.startswith("version"):
        return _old_scenes().scene(int(name[len("version_")]))
    from gasp_core import (
        Elastic,
        EngineAccuracy,
        EngineChoice,
        Gaussians,
        HalfSpace,
        Part,
        PythonMotion,
        RecordingChoice,
        Reduction,
        Scene,
        SplatObject,
    )

    rng = np.random.default_rng(0)
    degree = 1 if name.startswith("all") else 0
    splat = Gaussians(
        means=rng.normal(size=(30, 3)) / 3,
        quaternions=rng.normal(size=(30, 4)),
        scales=np.exp(rng.uniform(-6, -2, size=(30, 3))),
        opacities=rng.uniform(0.2, 1, size=30),
        harmonics=rng.normal(size=(30, (degree + 1) ** 2, 3)).astype(np.float32),
    )
    kind, own = name.partition("_")[0], dict[str, Any]()
    every = Reduction(mode="all")
    reductions = {
        "cores": Reduction(mode="cores", count=8),
        "all": every,
        "driven": every,
        "centres": Reduction(mode="centres"),
        "attached": Reduction(mode="cores", count=8, transfer="d-miso"),
        "mesh": Reduction(mode="mesh", mesh=_cage()),
    }
    reduction = reductions.get(kind)
    if kind == "driven":
        own["motion"] = PythonMotion(function=_old_scenes().sway, composition="driven")
        own["parts"] = (Part(region=HalfSpace(point=(0, 0, 0), normal=(1, 0, 0)), driven=True),)
    if reduction is None:
        splat, reduction = _ball(rng), Reduction(mode="volume")
    return Scene(
        duration=(FRAMES - 1) / 25,
        frame_rate=25.0,
        objects=(
            SplatObject(
                name="thing",
                splat=splat,
                material=Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3),
                reduction=reduction,
                **own,
            ),
        ),
        engine=EngineChoice(name="ballistic", options={"spin": 3.0}),
        accuracy=EngineAccuracy(resolution=64 if name.startswith("all") else 5),
        recording=RecordingChoice(checkpoint_frames=2, velocities=degree > 0),
    )


@functools.cache
def _cage() -> Path:
    """A mesh around everything."""
    path = Path(tempfile.mkdtemp()) / "cage.obj"
    corners = list(itertools.product((-1.5, 1.5), repeat=3))
    faces = [
        (1, 2, 4),
        (1, 4, 3),
        (5, 7, 8),
        (5, 8, 6),
        (1, 5, 6),
        (1, 6, 2),
        (3, 4, 8),
        (3, 8, 7),
        (1, 3, 7),
        (1, 7, 5),
    ]
    faces += [(2, 6, 8), (2, 8, 4)]
    lines = [*("v {} {} {}".format(*each) for each in corners), *("f {} {} {}".format(*each) for each in faces)]
    path.write_text("\n".join(lines))
    return path


def _ball(rng: np.random.Generator) -> Any:
    """Round Gaussians that enclose a ball."""
    from gasp_core import Gaussians

    ways = rng.normal(size=(300, 3))
    return Gaussians(
        means=ways / np.linalg.norm(ways, axis=1, keepdims=True),
        quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (300, 1)),
        scales=np.full((300, 3), 0.12),
        opacities=np.full(300, 0.9),
        harmonics=np.zeros((300, 1, 3), dtype=np.float32),
    )


@functools.cache
def _old_scenes() -> Any:
    sys.path.insert(0, str(KEPT))
    import scenes

    return scenes


def _run(scene: Any, path: Path, **others: Any) -> Any:
    import flying_points

    from gasp_core import simulate

    described = flying_points.descriptor()
    # It leads nothing, and what is recorded of what is led is what is tried.
    able = dataclasses.replace(described.capabilities, trajectories=True)
    engine: Any = (dataclasses.replace(described, capabilities=able), flying_points.Ballistic())
    return simulate(scene, engine=engine, out=path, progress=False, trust_code=True, **others)


@functools.cache
def _truth(name: str) -> tuple[Any, ...]:
    """The Gaussians of every frame of the whole run."""
    with tempfile.TemporaryDirectory() as folder:
        whole = _run(_scene(name), Path(folder) / "whole.gasp")
        return tuple(whole.gaussians(frame) for frame in range(whole.frame_count))


def recording_seeds() -> list[RecordingSeed]:
    """Carried in every way, finished and cut short, and those that earlier versions wrote."""
    seeds: list[RecordingSeed] = []
    with tempfile.TemporaryDirectory() as folder:
        kinds = ("cores", "all", "volume", "driven", "centres", "attached", "mesh")
        for kind, ending in itertools.product(kinds, ("whole", "cut")):
            name, frames = f"{kind}_{ending}", 4 if ending == "cut" else None
            path = Path(folder) / f"{name}.gasp"
            _run(_scene(name), path, frames=frames)
            parts = {file.relative_to(path).as_posix(): file.read_bytes() for file in path.rglob("*") if file.is_file()}
            seeds.append(RecordingSeed(name=f"{name}.zip", parts=parts))
    for version in (1, 3, 5, 6):
        with zipfile.ZipFile(KEPT / f"version_{version}.zip") as packed:
            parts = {
                key.partition("/")[2]: packed.read(key)
                for key in packed.namelist()
                if key.startswith("recording.gasp/") and not key.endswith("/")
            }
        seeds.append(RecordingSeed(name=f"version_{version}.zip", parts=parts))
    return seeds


# --- reading --------------------------------------------------------------------------------------------------------


def read_recording(path: Path) -> None:
    """Open, verify, export, render and resume; whatever is not refused of what is not forged must be the truth."""
    folder = path.with_suffix(".gasp")
    out = path.with_suffix(".out")
    try:
        told = _unpack(path, folder)
        # Before version 6 there are checksums of chunks alone.
        known = not told["forged"] and not path.name.startswith("version")
        truth = _truth(path.stem) if known else ()
        refused = [*_tried(lambda: _read(folder, truth)), *_tried(lambda: _show(folder, out))]
        refused += _tried(lambda: _resume(folder, path.stem, truth))
    finally:
        for left in (folder, out):
            _remove(left)
    for error in refused:
        raise error


def in_haste(folder: Path) -> None:
    """A flush shows only when the power fails, and threads where there are more than thirty rows: both cost time."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    os.fsync = lambda descriptor: None


def _unpack(path: Path, folder: Path) -> Any:
    """Its files, put where they belong; returns what else is told of them."""
    with zipfile.ZipFile(path) as packed:
        files = {key: packed.read(key) for key in packed.namelist()}
    told = json.loads(files.pop(_TOLD))
    folder.mkdir()
    for key, content in files.items():
        file = folder / key
        file.parent.mkdir(parents=True, exist_ok=True)
        match told["instead"].get(key):
            case "link":
                (folder.parent / "elsewhere").write_bytes(content)
                file.symlink_to(folder.parent / "elsewhere")
            case "device":
                file.symlink_to("/dev/zero")
            case "pipe":
                os.mkfifo(file)
            case "folder":
                file.mkdir()
            case "loop":
                file.symlink_to(file.name)
            case _:
                file.write_bytes(content)
    return told


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def _tried(do: Callable[[], None]) -> list[Exception]:
    """What was refused; all the rest of what may go wrong passes through."""
    from gasp_core.errors import GaspError

    try:
        do()
    except GaspError as error:
        return [error]
    return []


def _read(folder: Path, truth: tuple[Any, ...]) -> None:
    """Everything that a recording shows, and what ``gasp verify`` says of it."""
    from gasp_core import Recording
    from gasp_core.errors import GaspError
    from gasp_core.recording.verifying import verify

    refused: list[GaspError] = []
    verdict = verify(folder)
    recording = Recording.open(folder)
    numbers = sorted({*range(recording.frame_count), *recording.lost, *recording.torn})
    assert len(numbers) < 200_000
    for frame in numbers[:20]:
        try:
            found = recording.gaussians(frame)
            recording.diagnostics(frame)
        except GaspError as error:
            assert str(error).isprintable(), str(error)
            # What verify calls readable is read, where nobody forged it.
            assert not (truth and frame in verdict.readable), (frame, str(error), verdict)
            refused.append(error)
            continue
        _expect_true(found, truth, frame)
        assert not truth or frame in verdict.readable, (frame, verdict)
    for show in (lambda: str(recording), lambda: recording.reason, lambda: recording.scene, lambda: recording.bodies):
        refused += _tried(show)
    if recording.has_velocities:
        refused += _tried(lambda: recording.velocities(0))
    if refused:
        raise refused[0]


def _show(folder: Path, out: Path) -> None:
    """As ``gasp export`` and ``gasp render`` do."""
    from gasp_core.cli.main import main

    for command in (
        ["export", str(folder), "--all", "--out", str(out)],
        ["render", str(folder), "--out", f"{out / 'pictures'}/", "--size", "16x16", "--frame", "1"],
    ):
        told, printed = io.StringIO(), io.StringIO()
        with contextlib.redirect_stderr(told), contextlib.redirect_stdout(printed):
            status = main(command)
        lines = told.getvalue().splitlines()
        assert status in (0, 1, 2), status
        assert all(line.isprintable() and "internal error" not in line for line in lines), lines
        assert (status == 0) == (not lines), (status, lines)


def _resume(folder: Path, name: str, truth: tuple[Any, ...]) -> None:
    """Go on to the end of the run."""
    from gasp_core.errors import GaspError

    recording = _run(_scene(name), folder, resume=True)
    assert not truth or recording.frame_count == len(truth)
    for frame in range(len(truth)):
        try:
            found = recording.gaussians(frame)
        except GaspError as error:
            raise AssertionError(f"resumed, and yet: {error}") from error
        _expect_true(found, truth, frame)


def _expect_true(found: Any, truth: tuple[Any, ...], frame: int) -> None:
    if not truth:
        return
    assert frame < len(truth), frame
    for field in ("means", "quaternions", "scales", "opacities", "harmonics"):
        same = np.array_equal(getattr(found, field), getattr(truth[frame], field))
        assert same, f"{field} of frame {frame} are others"
