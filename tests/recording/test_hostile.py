"""Recordings made to do harm: each is refused in a line, and nothing of it is run."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import pickle
import shutil
import zipfile

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core import EngineAccuracy, Recording, RecordingChoice, Reduction
from gasp_core.cli.main import main
from gasp_core.errors import RecordingError
from gasp_core.recording.arrays import array_node, encoded, pieces, usual_chunks
from gasp_core.recording.checkpoints import load_checkpoint
from gasp_core.recording.creating import create_store
from gasp_core.recording.files import checksum
from gasp_core.recording.nodes import group, parsed, sealed
from gasp_core.recording.verifying import verify

COUNT = 700


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def path(kept, cloud, scene_of, run, tmp_path):
    """A recording of 700 Gaussians carried by cores, to be changed."""
    whole = kept / "whole.gasp"
    if not whole.exists():
        run(scene_of(cloud(COUNT), duration=0.08, reduction=Reduction(mode="cores", count=30)), whole)
    shutil.copytree(whole, tmp_path / "a.gasp")
    return tmp_path / "a.gasp"


def forge(path, key, content):
    """Put a file into a recording, and its checksum where it must stand: anybody can."""
    (path / key).write_bytes(content)
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["files"][key] = [len(content), checksum(content)]
    (path / "zarr.json").write_bytes(sealed(header))


def forge_node(path, key, change):
    node = json.loads((path / key).read_text())
    change(node)
    forge(path, key, sealed(node))


def refused(path, match):
    with pytest.raises(RecordingError, match=match) as error:
        Recording.open(path).gaussians(1)
    assert "\n" not in str(error.value)


class Payload:
    def __init__(self, marker):
        self.marker = marker

    def __reduce__(self):
        return os.system, (f"touch {self.marker}",)


@pytest.mark.parametrize("place", ["codec", "filter", "consolidated", "version 2"])
def test_a_pickle_is_not_run(path, tmp_path, capsys, place):
    marker = tmp_path / "it ran"
    evil = pickle.dumps(Payload(f"'{marker}'"))
    key = "reference/means/zarr.json"
    node = json.loads((path / key).read_text())
    old = {"zarr_format": 2, "shape": [COUNT, 3], "chunks": [COUNT, 3], "dtype": "|O", "fill_value": 0, "order": "C"}
    old |= {"filters": [{"id": "pickle"}], "compressor": {"id": "pickle"}}
    forge(path, "reference/means/c.0.0", evil)
    (path / "reference" / "means" / "0.0").write_bytes(evil)
    if place == "codec":
        forge_node(path, key, lambda node: node["codecs"].append({"name": "numcodecs.pickle", "configuration": {}}))
    elif place == "filter":
        forge_node(path, key, lambda node: node.update(filters=[{"id": "pickle"}], data_type="object"))
    elif place == "consolidated":
        root = json.loads((path / "zarr.json").read_text())
        metadata = {"reference/means": old}
        root["consolidated_metadata"] = {"kind": "inline", "must_understand": False, "metadata": metadata}
        (path / "zarr.json").write_bytes(sealed(root))
    else:
        (path / key).unlink()
        (path / "reference" / "means" / ".zarray").write_text(json.dumps(old))
    assert node["node_type"] == "array"
    assert main(["export", str(path), "--all", "--out", str(tmp_path / "out")]) == 2
    assert main(["render", str(path), "--out", str(tmp_path / "still.png"), "--frame", "1"]) == 2
    assert main(["verify", str(path)]) in (1, 2)
    errors = capsys.readouterr().err.strip().splitlines()
    assert errors and all(line.startswith("gasp: ") and "internal" not in line for line in errors)
    assert not marker.exists()


FIT = "bodies/0/levels/0/transfer"


def rewritten(path, name, change):
    """An array of a fit with other values, and all checksums as they must be."""
    recording = Recording.open(path)
    fit = recording.bodies[0].carrier.levels[0].transfer
    values = np.array(getattr(fit, name))
    change(values)
    chunk = "c.0" if values.ndim == 1 else "c.0.0"
    forge(path, f"{FIT}/{name}/{chunk}", encoded(values))


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("order", 5000, "order names rows that there are not"),
        ("order", -1, "order names rows that there are not"),
        ("neighbours", 30, "neighbours names cores that there are not"),
        ("neighbours", -5, "neighbours names cores that there are not"),
        ("labels", 30, "labels names cores that there are not"),
        ("weights", np.nan, "is not finite"),
        ("weights", 0.5, "weights do not add up to one"),
        ("inverses", np.inf, "is not finite"),
    ],
)
def test_what_a_compiled_loop_would_take_as_it_is_is_checked(path, name, value, says):
    def change(values):
        values.reshape(-1)[11] = value

    rewritten(path, name, change)
    refused(path, says)


@pytest.fixture
def filled(kept, scene_of, run, tmp_path):
    """A recording of a shell carried by the points that fill it, to be changed."""
    whole = kept / "filled.gasp"
    if not whole.exists():
        ball = shell(SHAPES["sphere"], count=COUNT)
        scene = scene_of(ball, duration=0.08, reduction=Reduction(mode="volume"), accuracy=EngineAccuracy(resolution=6))
        run(scene, whole)
    shutil.copytree(whole, tmp_path / "b.gasp")
    return tmp_path / "b.gasp"


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("order", 5000, "order names rows that there are not"),
        ("order", -1, "order names rows that there are not"),
        ("order", 0, "order leaves rows out"),
        ("neighbours", 10**6, "neighbours names points that there are not"),
        ("labels", -1, "labels names points that there are not"),
        ("standing_for", COUNT, "standing_for names rows that there are not"),
        ("weights", np.nan, "is not finite"),
        ("weights", 0.75, "weights do not add up to one"),
        ("weights", -1, "weights do not add up to one"),
        ("points", np.inf, "is not finite"),
        ("spacing", 0.0, "its points have no spacing"),
        ("spacing", -1.0, "its points have no spacing"),
    ],
)
def test_what_points_of_a_body_say_is_checked(filled, name, value, says):
    values = np.array(Recording.open(filled).bodies[0].carrier.arrays()[name])
    values.reshape(-1)[: 2 if name == "order" else 1] = value
    forge(filled, f"bodies/0/{name}/{'c.0' if values.ndim == 1 else 'c.0.0'}", encoded(values))
    refused(filled, says)


def test_a_body_has_no_more_points_than_are_there(filled):
    header = json.loads((filled / "zarr.json").read_text())
    header["attributes"]["bodies"][0]["last"] = 2**40
    (filled / "zarr.json").write_bytes(sealed(header))
    refused(filled, "points")


def test_values_that_float32_does_not_hold_are_not_finite(path):
    points = Recording.open(path).start_points
    points[3] = 1e300
    forge(path, "reference/points/c.0.0", encoded(points))
    with pytest.raises(RecordingError, match="is not finite"):
        Recording.open(path).points(1)


@pytest.mark.parametrize(
    ("name", "value"),
    [("warnings", 2), ("warnings", None), ("substeps", -1), ("largest_substep", "x"), ("kinetic_energy", True)],
)
def test_diagnostics_that_are_none_are_refused(path, name, value):
    node = json.loads((path / "commits" / "00000001" / "zarr.json").read_text())
    node["attributes"]["diagnostics"][name] = value
    if value is None:
        del node["attributes"]["diagnostics"][name]
    (path / "commits" / "00000001" / "zarr.json").write_bytes(sealed(node))
    with pytest.raises(RecordingError, match=r"commits/00000001/zarr\.json is damaged"):
        Recording.open(path).gaussians(1)


def test_an_order_that_leaves_rows_out_is_refused(path):
    def change(values):
        values[0] = values[1]

    rewritten(path, "order", change)
    refused(path, "order leaves rows out")


def test_links_pipes_and_folders_in_the_place_of_files_are_refused(path, tmp_path):
    file = path / "reference" / "means" / "c.0.0"
    aside = tmp_path / "aside"
    file.rename(aside)
    file.symlink_to(aside)
    refused(path, r"reference/means/c\.0\.0 is no file")
    assert main(["verify", str(path)]) == 1
    file.unlink()
    os.mkfifo(file)
    refused(path, r"reference/means/c\.0\.0 is no file")
    file.unlink()
    file.symlink_to("/dev/zero")
    refused(path, r"reference/means/c\.0\.0 is no file")
    file.unlink()
    file.mkdir()
    refused(path, r"reference/means/c\.0\.0 is no file")
    folder = path / "frames" / "displacements"
    folder.rename(tmp_path / "elsewhere")
    folder.symlink_to(tmp_path / "elsewhere")
    shutil.rmtree(file)
    aside.rename(file)
    refused(path, "frames/displacements")


@pytest.mark.parametrize("key", ["zarr.json", "commits/00000001/zarr.json", "frames/displacements/zarr.json"])
def test_a_pipe_instead_of_metadata_is_refused_at_once(path, key):
    (path / key).unlink()
    os.mkfifo(path / key)
    refused(path, "is no file|has no frame|is lost|frame 1")


@pytest.mark.parametrize("text", ["[" * 200_000, "{" * 100, '{"a":' * 100_000 + "1" + "}" * 100_000, "9" * 50_000])
@pytest.mark.parametrize("key", ["zarr.json", "frames/displacements/zarr.json", "commits/00000000/zarr.json"])
def test_metadata_that_are_too_deep_or_no_metadata_are_refused(path, key, text):
    (path / key).write_text(text)
    with pytest.raises(RecordingError, match=r"zarr\.json"):
        Recording.open(path).gaussians(0)


def test_metadata_that_are_deep_within_their_attributes_are_refused(path):
    node = json.loads((path / "zarr.json").read_text())
    deep: list = []
    for _ in range(100):
        deep = [deep]
    node["attributes"]["engine"]["options"] = {"deep": deep}
    (path / "zarr.json").write_bytes(sealed(node))
    with pytest.raises(RecordingError, match=r"zarr\.json is damaged"):
        Recording.open(path)


def test_metadata_that_are_too_long_are_not_read(path):
    with (path / "zarr.json").open("r+b") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(RecordingError, match="are the most for it"):
        Recording.open(path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"shape": [1 << 39, 3]}, "reference/means is damaged"),
        ({"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [1, 3]}}}, "in chunks of"),
        ({"data_type": "complex128"}, "is in no recording"),
        ({"data_type": ["float64"]}, "is in no recording"),
        ({"storage_transformers": [{"name": "evil"}]}, "no array of a recording"),
        ({"chunk_key_encoding": {"name": "v2", "configuration": {"separator": "/"}}}, "not named as in a recording"),
        ({"codecs": [{"name": "bytes"}]}, "codecs are not those"),
        ({"fill_value": "NaN"}, "not filled with zeros"),
    ],
)
def test_metadata_of_an_array_are_held_against_what_recordings_are_made_of(path, change, says):
    forge_node(path, "reference/means/zarr.json", lambda node: node.update(change))
    refused(path, says)


def test_a_chunk_that_would_unpack_to_more_is_not_unpacked(path):
    forge(path, "reference/means/c.0.0", encoded(np.zeros(2_000_000, dtype=np.float64)))
    refused(path, "would not unpack to a chunk of its array")


def test_more_gaussians_than_the_files_can_hold_are_refused(path):
    count = 1 << 33

    def grow(node):
        node["attributes"]["objects"][0]["last"] = count

    header = json.loads((path / "zarr.json").read_text())
    grow(header)
    (path / "zarr.json").write_bytes(sealed(header))
    forge_node(path, "reference/harmonics/zarr.json", lambda node: node.update(shape=[count, 1, 3]))
    refused(path, "cannot honestly mean")


@pytest.mark.parametrize("name", ["../outside", "/etc/passwd", "reference/../../x", "a\x00b"])
def test_files_outside_are_not_named(path, name):
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["files"][name] = [1, 1]
    (path / "zarr.json").write_bytes(sealed(header))
    with pytest.raises(RecordingError, match="names a file that is none of its own"):
        Recording.open(path)


def forge_commit(path, change):
    key = path / "commits" / "00000001" / "zarr.json"
    node = json.loads(key.read_text())
    change(node["attributes"])
    key.write_bytes(sealed(node))


@pytest.mark.parametrize("rows", [0, None, "", True, [0], [[1]], [[0, 700]], [[-1, 0]], [[0.5, 0]], [["1e0", "0"]]])
def test_rows_without_a_frame_that_are_none_are_refused(path, rows):
    forge_commit(path, lambda commit: commit.update(degenerate=[rows]))
    refused(path, r"commits/00000001/zarr\.json is damaged")
    assert main(["verify", str(path)]) == 1


@pytest.mark.parametrize("key", ["x" * 5000, "\x00", "\u202e", "a\nb"])
def test_a_field_that_there_is_not_is_named_in_a_line(path, key, capsys):
    forge_commit(path, lambda commit: commit.update({key: 1}))
    refused(path, r"commits/00000001/zarr\.json is damaged")
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["objects"][0][key] = 1
    (path / "zarr.json").write_bytes(sealed(header))
    with pytest.raises(RecordingError, match="the header of the recording is damaged") as error:
        Recording.open(path)
    assert str(error.value).isprintable() and len(str(error.value)) < 1000


def test_a_run_of_frames_that_there_are_not_is_refused_at_once(path, tmp_path):
    node = json.loads((path / "status" / "zarr.json").read_text())
    node["attributes"]["frames_wanted"] = 10**7
    (path / "status" / "zarr.json").write_bytes(sealed(node))
    assert main(["export", str(path), "--all", "--out", str(tmp_path / "out")]) == 2
    assert main(["verify", str(path)]) in (1, 2)


@pytest.mark.parametrize("placement", [{}, 3, {"rotation": [[1, 2], [3]], "scale": 1, "translation": [0, 0, 0]}])
def test_a_placement_that_is_none_is_refused(path, placement):
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["objects"][0]["placement"] = placement
    (path / "zarr.json").write_bytes(sealed(header))
    with pytest.raises(RecordingError, match="an object is placed nowhere"):
        Recording.open(path)


def test_metadata_of_a_million_parts_are_not_parsed(path):
    (path / "zarr.json").write_text('{"a": [' + "{}," * 1_000_000 + "0]}")
    with pytest.raises(RecordingError, match=r"zarr\.json is damaged: it is no metadata"):
        Recording.open(path)


def test_a_scene_of_many_objects_is_read_again_and_one_of_too_many_is_not_begun(path, tmp_path):
    header = Recording.open(path).header
    many = dataclasses.replace(header, objects=header.objects * 3000, bodies=header.bodies * 3000)
    content = sealed(group(many.attributes()))
    assert len(content) > 1 << 20 and parsed(path, "zarr.json", content)["attributes"]["objects"]
    more = dataclasses.replace(header, objects=header.objects * 30_000)
    with pytest.raises(RecordingError, match=r"30,000 objects are more than a recording can name"):
        create_store(tmp_path / "new", more, {}, {}, 1)


def test_a_carrier_has_no_arrays_but_its_own(path):
    name = "bodies/0/x0"
    node, chunks = pieces(np.zeros((COUNT, 12)), (COUNT, 12))
    (path / name).mkdir()
    forge(path, f"{name}/zarr.json", sealed(array_node(node)))
    for key, values in chunks.items():
        forge(path, f"{name}/{key}", encoded(values))
    refused(path, r"bodies/0/x0 is damaged: no carrier has such an array")


def test_a_carrier_does_not_unpack_to_more_than_it_can_mean(kept, cloud, scene_of, run, tmp_path):
    # So many that the memory any file may take is not enough for all of what a carrier could be told to have.
    many = kept / "many.gasp"
    if not many.exists():
        run(scene_of(cloud(30_000), duration=0.04, reduction=Reduction(mode="all")), many)
    path = shutil.copytree(many, tmp_path / "many.gasp")
    for level in range(9):
        for part in ("labels", "neighbours", "weights", "inverses", "fallen", "order"):
            name = f"bodies/0/levels/{level}/transfer/{part}"
            node, chunks = pieces(np.zeros((30_000, 12)), usual_chunks((30_000, 12)))
            (path / name).mkdir(parents=True)
            forge(path, f"{name}/zarr.json", sealed(array_node(node)))
            for key, values in chunks.items():
                forge(path, f"{name}/{key}", encoded(values))
    refused(path, "it would unpack to more than it can mean")


def test_the_parts_of_a_commit_are_bounded_by_what_its_recording_holds(path):
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["objects"][0]["last"] = 2**39
    (path / "zarr.json").write_bytes(sealed(header))
    forge_commit(path, lambda commit: commit["diagnostics"].update(x=[[]] * 2_000_000))
    with pytest.raises(RecordingError, match="it is no metadata that GASP writes"):
        Recording.open(path).commit(1)


@pytest.mark.parametrize("size", [2**40 - 1, 10**30, -1, 1.5, "1"])
def test_no_length_that_is_only_told_is_read(path, size):
    forge_commit(path, lambda commit: commit["chunks"].update({"frames/displacements/c.1.0.0": [size, 0]}))
    refused(path, "damaged")
    node = json.loads((path / "checkpoints" / "00000002" / "zarr.json").read_text())
    node["attributes"]["files"]["c.0"][0] = size
    (path / "checkpoints" / "00000002" / "zarr.json").write_bytes(sealed(node))
    with pytest.raises(RecordingError, match="damaged"):
        load_checkpoint(path, 2, sealed=True)
    header = json.loads((path / "zarr.json").read_text())
    header["attributes"]["files"]["reference/means/c.0.0"][0] = size
    (path / "zarr.json").write_bytes(sealed(header))
    assert main(["verify", str(path)]) in (1, 2)


def test_a_file_that_has_grown_is_not_read(path):
    file = path / "frames" / "displacements" / "c.1.0.0"
    size = file.stat().st_size
    os.truncate(file, 1 << 40)
    refused(path, rf"has {1 << 40:,} bytes, expected {size:,}")
    os.truncate(path / "reference" / "means" / "c.0.0", 1 << 40)
    assert any("reference/means/c.0.0 is damaged: has" in line for line in verify(path).damaged)


def archive(header, flag=0):
    """A state of one array with that header, its archive's flags changed."""
    filled = header.encode() + b" " * (-(10 + len(header) + 1) % 64) + b"\n"
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as parts:
        parts.writestr("a0.npy", b"\x93NUMPY\x01\x00" + len(filled).to_bytes(2, "little") + filled + bytes(24))
    content = bytearray(packed.getvalue())
    content[6] |= flag
    content[content.index(b"PK\x01\x02") + 8] |= flag
    return bytes(content)


SHAPED = "{{'descr': '<f8', 'fortran_order': False, 'shape': {}}}"


@pytest.mark.parametrize(
    "content",
    [
        archive(SHAPED.format("(3,")),
        archive(SHAPED.format("(3,)"), flag=1),
        archive(SHAPED.format(f"({10**28},)")),
        archive(SHAPED.format("(1000000000,)")),
        archive(SHAPED.format("(-3,)")),
        archive(SHAPED.format("(" * 3000 + ")" * 3000)),
        archive("{'descr': '|O', 'fortran_order': False, 'shape': (3,)}"),
        b"PK",
    ],
)
def test_a_state_that_is_none_is_refused_in_a_line(path, content, capsys):
    node, chunks = pieces(np.frombuffer(content, dtype=np.uint8), (len(content),))
    files = {key: encoded(values, "lz4", "bitshuffle") for key, values in chunks.items()}
    told = {"names": ["steps"], "files": {key: [len(file), checksum(file)] for key, file in files.items()}}
    folder = path / "checkpoints" / "00000002"
    for key, file in files.items():
        (folder / key).write_bytes(file)
    (folder / "zarr.json").write_bytes(sealed(array_node(node, told, "lz4", "bitshuffle")))
    with pytest.raises(RecordingError, match="checkpoints/00000002 is damaged"):
        load_checkpoint(path, 2, sealed=True)
    assert main(["verify", str(path)]) == 1
    assert "checkpoints/00000002 is damaged" in capsys.readouterr().out


def test_a_file_that_is_no_frame_of_the_array_is_named_and_let_be(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    run(scene_of(duration=0.2), path, frames=3)
    stray = path / "frames" / "displacements" / "c.bak"
    stray.write_text("mine")
    assert "frames/displacements/c.bak is not of the recording" in verify(path).notes
    assert run(scene_of(duration=0.2), path, resume=True).status == "complete"
    assert stray.read_text() == "mine"


def test_velocities_that_are_damaged_cost_no_gaussians(scene_of, run, tmp_path):
    path = tmp_path / "a.gasp"
    run(scene_of(duration=0.08, recording=RecordingChoice(checkpoint_frames=1, velocities=True)), path)
    (path / "frames" / "velocities" / "c.1.0.0").write_bytes(b"")
    found = verify(path)
    assert found.readable == (0, 1, 2) and found.lost == ()
    assert [line.partition(" ")[0] for line in found.damaged] == ["frames/velocities/c.1.0.0"]
    with pytest.raises(RecordingError, match=r"frames/velocities/c\.1\.0\.0"):
        Recording.open(path).velocities(1)
