"""Splat files that are not what they seem: one clear line, status 2, nothing left behind."""

import gzip
import io
import json
import struct
import zipfile

import numpy as np
import pytest

HEADER = "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
NEEDED = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"]
NEEDED += ["rot_0", "rot_1", "rot_2", "rot_3"]


def ply(count, rows, names=NEEDED):
    properties = "".join(f"property float {name}\n" for name in names)
    header = HEADER.format(count=count, properties=properties).encode()
    return header + np.ones((rows, len(names)), dtype="<f4").tobytes()


def zipped(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def sog_meta(count=4, **files):
    names = {"means": ["means_l.webp", "means_u.webp"], "scales": ["scales.webp"], "quats": ["quats.webp"]}
    names |= {"sh0": ["sh0.webp"]} | files
    meta = {"version": 2, "count": count}
    for part, own in names.items():
        meta[part] = {"files": own, "mins": [0, 0, 0], "maxs": [1, 1, 1], "codebook": [0.0] * 256}
    return json.dumps(meta)


def spz(count, version=2, payload=b"\0" * 64, magic=b"NGSP"):
    return gzip.compress(magic + struct.pack("<IIBBBB", version, count, 0, 12, 0, 0) + payload)


CASES = {
    "empty.ply": (b"", "empty"),
    "empty.splat": (b"", "empty"),
    "cut_header.ply": (ply(4, 4)[:60], "header"),
    "cut_data.ply": (ply(4, 3), "4"),
    "boast.ply": (ply(10**15, 4), "1000000000000000"),
    "negative.ply": (ply(-4, 4), "-4"),
    "no_opacity.ply": (ply(4, 4, [name for name in NEEDED if name != "opacity"]), "opacity"),
    "half_a_rotation.ply": (ply(4, 4, NEEDED[:-1]), "rot_3"),
    "no_position.ply": (ply(4, 4, NEEDED[2:]), "x"),
    "wrong_magic.ply": (b"PNG\r\n" + bytes(200), "ply"),
    "pointer.ply": (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 5\n", "git"),
    "odd_length.splat": (bytes(33), "32"),
    "wrong_magic.spz": (spz(4, magic=b"XXXX"), "spz"),
    "cut.spz": (spz(4)[:20], "gzip"),
    "boast.spz": (spz(2**31 - 1), "2,147,483,647"),
    "not_gzip.spz": (b"hello, this is a text", "spz"),
    "empty.sog": (zipped(), ".sog"),
    "not_zip.sog": (b"PK\x03\x04 but nothing else", "zip"),
    "bad_json.sog": (zipped(**{"meta.json": "{"}), "meta.json"),
    "bomb.sog": (zipped(**{"meta.json": sog_meta(), "means_l.webp": bytes(2**27)}), "means_l.webp"),
    "escape.sog": (zipped(**{"meta.json": sog_meta(means=["../../toy.webp", "means_u.webp"])}), "../"),
    "absolute.sog": (zipped(**{"meta.json": sog_meta(means=["/etc/passwd", "means_u.webp"])}), "/etc/passwd"),
    "no_image.sog": (zipped(**{"meta.json": sog_meta()}), "means_l.webp"),
    "model.obj": (b"v 0 0 0\nf 1 1 1\n", "obj"),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("command", ["inspect", "convert", "run"])
def test_file_that_is_malformed(refused, workplace, name, command):
    content, said = CASES[name]
    (workplace / name).write_bytes(content)
    if command == "run":
        scene = workplace / "scene.toml"
        scene.write_text(scene.read_text().replace("toy.ply", name))
        arguments = ["run", scene]
    else:
        arguments = [command, name] + (["out.ply"] if command == "convert" else [])
    line = refused(*arguments, says=[name])
    assert said.lower() in line.lower()


def test_file_that_is_not_there(refused):
    refused("inspect", "nowhere.ply", says=["nowhere.ply", "No such file", "check the path"])
    refused("convert", "nowhere.ply", "out.ply", says=["nowhere.ply", "No such file"])


def test_folder_without_meta(refused, workplace):
    (workplace / "frames").mkdir()
    refused("inspect", "frames", says=["frames", "meta.json"])


def test_file_name_with_a_newline_stays_on_one_line(refused):
    refused("inspect", "two\nlines.ply", says=["lines.ply"])


def test_numbers_that_are_none_are_told_by_inspect(gasp, workplace):
    rows = np.frombuffer(ply(4, 4)[-4 * 14 * 4 :], dtype="<f4").reshape(4, 14).copy()
    rows[2, 0] = np.nan
    (workplace / "nan.ply").write_bytes(ply(4, 0) + rows.tobytes())
    outcome = gasp("inspect", "nan.ply", "--json")
    summary = json.loads(outcome.out)
    assert (outcome.status, summary["count"]) == (0, 4)
    assert any("finite" in sentence for sentence in summary["oddities"])


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("out.xyz", ["out.xyz", ".ply"]),
        ("out.ksplat", ["out.ksplat", ".ply"]),
        ("out", ["out", ".ply"]),
        ("nofolder/out.ply", ["nofolder/out.ply", "No such file or directory", "choose a folder"]),
        ("toy.ply/out.ply", ["toy.ply/out.ply", "Not a directory"]),
        ("toy.ply", ["toy.ply", "is what is read"]),
    ],
)
def test_target_that_cannot_be_written(refused, target, says):
    refused("convert", "toy.ply", target, says=says)


def test_target_that_is_a_folder(refused, workplace):
    (workplace / "out.ply").mkdir()
    refused("convert", "toy.ply", "out.ply", says=["out.ply", "folder"])


def test_an_existing_target_survives_a_failure(refused, workplace):
    (workplace / "bad.ply").write_bytes(CASES["cut_data.ply"][0])
    (workplace / "good.ply").write_bytes(b"precious")
    refused("convert", "bad.ply", "good.ply", "--overwrite", says=["bad.ply"])
