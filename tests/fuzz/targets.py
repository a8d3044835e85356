"""What is mutated: good files of every kind, and what reads them.

A target is an entry of `TARGETS`: good files as `Seed`s, and a function that reads one as the program does and raises
nothing but `GaspError`.
"""

from __future__ import annotations

import gzip
import io
import json
import random
import sys
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import splat_files
from conversations import read_conversation, said
from mutation import mutated
from recordings import RecordingSeed, in_haste, read_recording, recording_seeds

ROOT = Path(__file__).parents[2]

Parts = Mapping[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class Seed:
    """A good file.

    Parameters
    ----------
    name
        Of the file; its suffix matters.
    parts
        What it is packed of, so that damage can lie behind its checksums.
    pack
        The file of its parts.
    """

    name: str
    parts: Parts
    pack: Callable[[Parts], bytes]

    def mutant(self, others: list[bytes], chance: random.Random) -> bytes:
        """The file, damaged before it was packed or afterwards."""
        if len(self.parts) == 1 and self.pack is _alone:
            return mutated(self.parts[self.name], others, chance)
        if chance.random() < 0.3:
            return mutated(self.pack(self.parts), others, chance)
        part = chance.choice(sorted(self.parts))
        return self.pack({**self.parts, part: mutated(self.parts[part], [*others, *self.parts.values()], chance)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A kind of input: `prepare` puts beside the mutants what they name, `seeds` are mutated, `read` reads one."""

    seeds: Callable[[], Sequence[Seed | RecordingSeed]]
    read: Callable[[Path], None]
    prepare: Callable[[Path], None] = lambda folder: None


def _alone(parts: Parts) -> bytes:
    (content,) = parts.values()
    return content


def plain(name: str, content: bytes) -> Seed:
    """A file without packing."""
    return Seed(name=name, parts={name: content}, pack=_alone)


# --- splats ---------------------------------------------------------------------------------------------------------


def splat_seeds() -> list[Seed]:
    """Small files of every format."""
    rng = np.random.default_rng(0)

    def inria(degree: int, kind: str, order: str) -> bytes:
        names = splat_files.inria_names(degree)
        return splat_files.ply([(name, kind) for name in names], rng.normal(size=(20, len(names))), order=order)

    rows = np.zeros(20, np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("rotation", "u1", 4)]))
    rows["mean"], rows["scale"], rows["rgba"] = rng.normal(size=(20, 3)), 0.1, 200
    seeds = [
        plain("float.ply", inria(1, "float", "<")),
        plain("double.ply", inria(0, "double", ">")),
        plain("text.ply", inria(0, "float", "")),
        plain("old.compressed.ply", splat_files.compressed_ply(20, 1, old=True)),
        plain("new.compressed.ply", splat_files.compressed_ply(300, 0)),
        plain("a.splat", rows.tobytes()),
        plain("v4.spz", splat_files.spz(4, 20, 1)[0]),
        Seed(name="cloud.glb", parts=_parts_of_glb(splat_files.cloud_glb(20, 1)), pack=_glb),
        Seed(name="packed.glb", parts=_parts_of_glb(splat_files.spz_glb(splat_files.spz(3, 20, 1)[0])), pack=_glb),
    ]
    for version in (1, 2, 3):
        inside = zlib.decompress(splat_files.spz(version, 20, 2)[0], wbits=31)
        seeds.append(Seed(name=f"v{version}.spz", parts={"inside": inside}, pack=_gzipped))
    for version in (1, 2):
        seeds.append(Seed(name=f"v{version}.sog", parts=splat_files.sog(version, 20, 1), pack=splat_files.zipped))
    return seeds


def _gzipped(parts: Parts) -> bytes:
    return gzip.compress(parts["inside"], mtime=0)


def _parts_of_glb(content: bytes) -> Parts:
    length = int.from_bytes(content[12:16], "little")
    return {"json": content[20 : 20 + length], "numbers": content[28 + length :]}


def _glb(parts: Parts) -> bytes:
    return splat_files.glb(parts["json"], parts["numbers"])


def stage_seeds() -> list[Seed]:
    """A stage of the toy, packed, as text and in a zip."""
    import tempfile

    from gasp_core.io import write_splat
    from gasp_core.toy import make_toy

    seeds: list[Seed] = []
    with tempfile.TemporaryDirectory() as folder:
        for suffix in (".usdc", ".usda"):
            write_splat(Path(folder) / f"a{suffix}", make_toy(16))
            seeds.append(plain(f"a{suffix}", (Path(folder) / f"a{suffix}").read_bytes()))
    packed = Seed(name="a.usdz", parts=seeds[0].parts, pack=_stored)
    return [*seeds, packed]


def read_splat(path: Path) -> None:
    """As ``gasp inspect`` does."""
    from gasp_core.io.inspect import inspect_splat

    summary = inspect_splat(path)
    summary.to_text()
    json.dumps(summary.to_json(), allow_nan=False)


# --- scenes ---------------------------------------------------------------------------------------------------------


def scene_seeds() -> list[Seed]:
    """The examples, all of the toy, and a scene with every other key."""
    seeds = [plain("all.toml", (Path(__file__).parent / "all_keys.toml").read_bytes())]
    for path in sorted((ROOT / "examples").glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        for name in ("ball.ply", "bar.ply", "castle.ply", "bucket.ply", "shovel.ply", "$GASP_DATA/splats/plant.splat"):
            text = text.replace(name, "toy.ply")
        seeds.append(plain(path.name, text.encode()))
    return seeds


def beside_scenes(folder: Path) -> None:
    """The splat, the columns and the cameras that the scenes name."""
    from gasp_core.io import write_splat
    from gasp_core.toy import make_toy

    write_splat(folder / "toy.ply", make_toy(64))
    _write_dancer(folder / "dancer")
    np.save(folder / "labels.npy", np.arange(64) % 3)
    np.save(folder / "field.npy", np.linspace(1e4, 1e5, 64))
    (folder / "cameras.json").write_bytes(camera_seeds()[0].parts["cameras.json"])


def _write_dancer(folder: Path) -> None:
    """A checkpoint, as the example writes it, of two cores."""
    import runpy

    maker = runpy.run_path(str(ROOT / "examples" / "make_dancer.py"))
    bear = maker["make_toy"](64)
    cores, rows = maker["core_triangles"](bear.means.astype(np.float64))
    maker["write"](folder, bear.select(rows), cores, maker["train"](cores)[0])


def read_scene(path: Path) -> None:
    """As ``gasp run`` does until it opens the engine, and as a recording keeps the scene. Code is not run."""
    import dataclasses

    from gasp_core import load_scene, scene_to_toml
    from gasp_core.scene.digest import scene_digest
    from gasp_core.scene.loading import read_stored_scene
    from gasp_core.scene.motions import PythonMotion
    from gasp_core.simulation.splat_sources import prepare

    scene = load_scene(path)
    stored, forgotten = read_stored_scene(scene_to_toml(scene), file="stored")
    assert not forgotten
    assert stored.frame_count == scene.frame_count
    for item in scene.objects:
        assert item.name.isprintable()
    harmless = [
        dataclasses.replace(item, motion=None) if isinstance(item.motion, PythonMotion) else item
        for item in scene.objects
    ]
    prepared = prepare(dataclasses.replace(scene, objects=tuple(harmless)))
    scene_digest(scene, prepared.digests)


# --- columns --------------------------------------------------------------------------------------------------------


def column_seeds() -> list[Seed]:
    """A number for each of 20 Gaussians: arrays of several types, and a .ply with a property of its own."""
    rng = np.random.default_rng(0)
    seeds: list[Seed] = []
    for kind in ("<f4", ">f8", "u1", "<i8", "?"):
        stream = io.BytesIO()
        np.save(stream, rng.integers(0, 2, 20).astype(kind))
        seeds.append(plain(f"{kind[-2:].strip('?<>') or 'truth'}.npy", stream.getvalue()))
    names = [*((name, "float") for name in splat_files.inria_names(0)), ("label", "int")]
    return [*seeds, plain("label.ply", splat_files.ply(names, rng.normal(size=(20, len(names)))))]


def read_column(path: Path) -> None:
    """As labels and fields of a scene, and as ``gasp inspect`` does."""
    from gasp_core.io.columns import own_columns, read_npy_column, read_ply_column

    if path.suffix == ".ply":
        assert read_ply_column(path, "label").ndim == 1
        own_columns(path)
    else:
        assert read_npy_column(path, 20).shape == (20,)


# --- cameras --------------------------------------------------------------------------------------------------------


def camera_seeds() -> list[Seed]:
    """A cameras.json, and two transforms.json of different habits."""
    eye = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    listed = [
        {"id": k, "img_name": f"im/{k}.png", "width": 640, "height": 480, "position": [0.5 * k, -2.0, 1.0],
         "rotation": eye, "fx": 500.0, "fy": 510.0}
        for k in range(3)
    ]  # fmt: skip
    pose = [[1.0, 0.0, 0.0, 0.1], [0.0, 0.0, -1.0, -3.0], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]]
    frames = [{"file_path": f"./train/r_{k}", "transform_matrix": pose} for k in "ab"]
    angles = {"camera_angle_x": 0.7, "frames": frames}
    sizes = {"w": 640, "h": 480, "fl_x": 500.0, "fl_y": 505.5, "cx": 320.0, "cy": 241.0,
             "frames": [{"file_path": "a.png", "transform_matrix": pose[:3]}]}  # fmt: skip
    named = {"cameras.json": listed, "transforms.json": angles, "transforms_sizes.json": sizes}
    return [plain(name, json.dumps(value, indent=1).encode()) for name, value in named.items()]


def read_cameras(path: Path) -> None:
    """As ``gasp render --camera`` does until it draws."""
    from gasp_core.rendering.camera_files import choose, placed, read_cameras
    from gasp_core.scene.placement import Placement

    cameras = read_cameras(path)
    here = Placement(rotation=np.eye(3), scale=0.3, translation=np.ones(3))
    for entry in cameras:
        assert entry.name.isprintable()
        seen = placed(choose([entry], entry.name or 0, path), here).resized(320, 240)
        seen.project(np.zeros((4, 3)))
        assert np.isfinite(seen.position).all()


# --- a reader with every fault there is, which the harness must find ------------------------------------------------


def read_badly(path: Path) -> None:
    """Does one of what no reader may do, by the first byte; b"g" is the good file's."""
    import os
    import signal

    from gasp_core.errors import SceneError

    match path.read_bytes()[:1]:
        case b"g":
            pass
        case b"r":
            raise SceneError("as it should be")
        case b"f":
            raise ValueError("of another kind")
        case b"l":
            raise SceneError("two\nlines")
        case b"m":
            np.ones(20 << 20).sum()
        case b"h":
            while True:
                pass
        case b"c":
            os.kill(os.getpid(), signal.SIGSEGV)
        case _:
            sys.exit(7)


def _one_by_one(parts: Parts) -> bytes:
    return b"mhcefflrrggrg"[zlib.crc32(parts["any"]) % 13 :]


FAULTY = Target(
    seeds=lambda: [Seed(name="any", parts={"any": b"".join(bytes([k]) for k in range(1, 33))}, pack=_one_by_one)],
    read=read_badly,
)

# --- what other programs write ---------------------------------------------------------------------------------------


def archive_seeds() -> list[Seed]:
    """What PyTorch saved, its parts damaged behind the checksums of the zip too."""
    with zipfile.ZipFile(ROOT / "tests" / "io" / "saved_by_torch.pt") as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    return [Seed(name="saved.pt", parts=parts, pack=_stored)]


def _stored(parts: Parts) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return stream.getvalue()


def read_archive(path: Path) -> None:
    """As checkpoints are read."""
    from gasp_core.io.torch_archives import read_archive

    read_archive(path)


def soup_seeds() -> list[Seed]:
    """A soup of the toy, and what a program may have made of it."""
    from gasp_core.io.soups import make_soup, write_soup
    from gasp_core.toy import make_toy

    stream, moved = io.BytesIO(), io.BytesIO()
    soup = make_soup(make_toy(16))
    write_soup(stream, soup)
    np.save(moved, soup.positions.reshape(-1, 3))
    return [plain("a.soup.ply", stream.getvalue()), plain("moved.npy", moved.getvalue())]


def read_soup(path: Path) -> None:
    """As ``gasp soup import`` does."""
    from gasp_core.io.soups import make_soup, read_positions, read_soup, splat_of
    from gasp_core.toy import make_toy

    toy = make_toy(16)
    known = make_soup(toy)
    if path.suffix == ".ply":
        read_soup(path)
    for positions in read_positions(path, known):
        splat_of(known, toy, positions)


TARGETS: dict[str, Target] = {
    "splats": Target(seeds=splat_seeds, read=read_splat),
    "stages": Target(seeds=stage_seeds, read=read_splat),
    "scenes": Target(seeds=scene_seeds, read=read_scene, prepare=beside_scenes),
    "columns": Target(seeds=column_seeds, read=read_column),
    "cameras": Target(seeds=camera_seeds, read=read_cameras),
    "archives": Target(seeds=archive_seeds, read=read_archive),
    "soups": Target(seeds=soup_seeds, read=read_soup),
    "conversations": Target(seeds=lambda: [plain("worker.jsonl", said())], read=read_conversation),
    "recordings": Target(seeds=recording_seeds, read=read_recording, prepare=in_haste),
}
HIDDEN: dict[str, Target] = {"faulty": FAULTY}
"""Not fuzzed unless somebody names them."""
