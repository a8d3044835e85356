"""What is not a splat, or no longer: one line that says what, where and what to do, at no cost in memory."""

import gzip
import io
import json
import os
import struct
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gasp_core.errors import SplatFormatError
from gasp_core.gaussians import Gaussians
from gasp_core.io import read_splat, write_splat
from gasp_core.io.inspect import inspect_splat


def refusal(call, path):
    """The message of a refusal: one line, naming the file, with a remedy behind the semicolon."""
    with pytest.raises(SplatFormatError) as error:
        call(path)
    text = str(error.value)
    assert text.isprintable()
    assert str(path).split("\0")[0] in text
    assert text.rsplit(";", 1)[-1].strip()
    return text


def inria(build, count=3, degree=0, **options):
    names = build.inria_names(degree)
    rows = np.random.default_rng(0).normal(size=(count, len(names)))
    return build.ply([(name, "float") for name in names], rows, **options)


def meta_with(files, text):
    return {**files, "meta.json": text}


def swapped(content, old, new):
    assert old in content
    return content.replace(old, new, 1)


CASES = {
    # name: (file name, content from builders, what the message says)
    "empty": ("a.ply", lambda b: b"", "is empty"),
    "empty splat": ("a.splat", lambda b: b"", "is empty"),
    "wrong magic": ("a.ply", lambda b: b"PLY\n" + bytes(100), r"does not begin as a \.ply"),
    "wrong magic spz": ("a.spz", lambda b: bytes(100), r"does not begin as a \.spz"),
    "wrong magic glb": ("a.glb", lambda b: bytes(100), r"does not begin as a \.glb"),
    "wrong magic usd": ("a.usdc", lambda b: bytes(100), r"does not begin as a \.usdc"),
    "wrong magic sog": ("a.sog", lambda b: bytes(100), r"does not begin as a \.sog"),
    "lfs pointer": ("a.ply", lambda b: b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "git lfs pull"),
    "annex pointer": ("a.ply", lambda b: b"/annex/objects/SHA256E-s12--00.ply\n", "git annex get"),
    "ksplat": ("a.ksplat", lambda b: bytes(4096), r"no known kind \('\.ksplat'\); splats are read from"),
    "obj": ("a.obj", lambda b: b"v 0 0 0\n", "is no splat; of a mesh `gasp convert` makes one"),
    "no suffix": ("a", lambda b: b"hello", "no suffix"),
    "header cut": ("a.ply", lambda b: inria(b)[:60], "no end_header"),
    "header endless": ("a.ply", lambda b: b"ply\n" + b"comment x\n" * 100_000, "no end_header"),
    "header nonsense": ("a.ply", lambda b: swapped(inria(b), b"format", b"fromat"), "means nothing"),
    "no format": (
        "a.ply",
        lambda b: swapped(inria(b), b"format binary_little_endian 1.0\n", b""),
        "names no format",
    ),
    "unknown format": ("a.ply", lambda b: swapped(inria(b), b"little", b"middle"), "unknown PLY format"),
    "negative count": ("a.ply", lambda b: inria(b, count=3).replace(b"vertex 3", b"vertex -3"), "impossible count"),
    "endless count": (
        "a.ply",
        lambda b: inria(b).replace(b"vertex 3", b"vertex " + b"9" * 5000),
        "impossible count",
    ),
    "count lies": (
        "a.ply",
        lambda b: inria(b).replace(b"vertex 3", b"vertex 900000000000"),
        r"900,000,000,000 rows needs 50,400,000,000,000 bytes, the file has 168",
    ),
    "count lies in text": (
        "a.ply",
        lambda b: inria(b, order="").replace(b"vertex 3", b"vertex 900000000000"),
        "needs 12,600,000,000,000 numbers, the file has 42",
    ),
    "rows cut": ("a.ply", lambda b: inria(b)[:-1], "needs 168 bytes, the file has 167"),
    "text that is no number": ("a.ply", lambda b: inria(b, order="")[:-4] + b"xxx\n", "no number"),
    "double beyond float32": (
        "a.ply",
        lambda b: b.ply([(n, "double") for n in b.inria_names(0)], [[0.0] * 14, [0.0] * 10 + [-1e39] + [0.0] * 3]),
        r"property 'rot_0' of Gaussian 1 is -1e\+39, beyond the 3\.4e38 of float32; drop",
    ),
    "double position beyond float32": (
        "a.ply",
        lambda b: b.ply([(n, "double") for n in b.inria_names(0)], [[1e300] + [0.0] * 13]),
        "property 'x' of Gaussian 0 is 1e",
    ),
    "text beyond float32": (
        "a.ply",
        lambda b: b.ply([(n, "float") for n in b.inria_names(0)], [[1e39] + [0.0] * 13], order=""),
        r"property 'x' of row 0 is 1e\+39, beyond",
    ),
    "text beyond float64": (
        "a.ply",
        lambda b: b.ply([(n, "double") for n in b.inria_names(0)], [[0.5] * 14], order="").replace(b"0.5", b"1e400"),
        "no number",
    ),
    "words without end": (
        "a.ply",
        lambda b: inria(b, order="").replace(b"vertex 3", b"vertex 4") + b"1" * (1 << 22),
        "no number",
    ),
    "too many elements": (
        "a.ply",
        lambda b: swapped(inria(b), b"end_header", b"element e%d 0\n" * 65 % tuple(range(65)) + b"end_header"),
        "more than 64 elements",
    ),
    "too many properties": (
        "a.ply",
        lambda b: swapped(inria(b), b"end_header", b"property char p%d\n" * 1024 % tuple(range(1024)) + b"end_header"),
        "element 'vertex' has more than 1024 properties",
    ),
    "zip of too many": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), **{f"{k}.txt": b"" for k in range(1000)}}),
        "more than 1000 files",
    ),
    "no rows": ("a.ply", lambda b: inria(b).replace(b"vertex 3", b"vertex 0"), "is empty"),
    "element twice": (
        "a.ply",
        lambda b: swapped(inria(b), b"element", b"element vertex 1\nelement"),
        "declared twice",
    ),
    "property twice": (
        "a.ply",
        lambda b: swapped(inria(b), b"property float rot_3", b"property float rot_2"),
        "declared twice",
    ),
    "unknown type": ("a.ply", lambda b: swapped(inria(b), b"float rot_3", b"quad rot_3"), "unknown property"),
    "lists": ("a.ply", lambda b: swapped(inria(b), b"property", b"property list uchar int l\nproperty"), "holds lists"),
    "a mesh": (
        "a.ply",
        lambda b: b.ply([(name, "float") for name in ("x", "y", "z", "nx", "ny", "nz")], np.zeros((3, 6))),
        r"lacks the properties rot_0, rot_1, rot_2, rot_3, scale_0, scale_1, \.\.\.; it is no splat",
    ),
    "odd harmonics": (
        "a.ply",
        lambda b: b.ply([(n, "float") for n in b.inria_names(1)[:-9]], np.zeros((1, 14))),
        r"properties f_rest_\*|lacks",
    ),
    "seven harmonics": (
        "a.ply",
        lambda b: swapped(inria(b, degree=1), b"f_rest_8", b"g_rest_8"),
        r"8 properties f_rest_\*; spherical harmonics take 0, 9, 24",
    ),
    "a gap in the harmonics": (
        "a.ply",
        lambda b: swapped(inria(b, degree=1), b"f_rest_8", b"f_rest_9"),
        "lacks the properties f_rest_8",
    ),
    "control characters in a name": (
        "a.ply",
        lambda b: swapped(inria(b), b"float rot_3", b"float rot_3\x1b[31m\x07"),
        "lacks the properties rot_3",
    ),
    "chunks lie": ("a.ply", lambda b: b.compressed_ply(300, 0, chunks=1), "need 2 chunks, it has 1"),
    "chunks without bounds": (
        "a.ply",
        lambda b: swapped(b.compressed_ply(300, 0), b"min_scale_x", b"mix_scale_x"),
        "lacks the float min_scale_x",
    ),
    "words of another type": (
        "a.ply",
        lambda b: swapped(b.compressed_ply(300, 0), b"uint packed_color", b"float packed_color"),
        "lacks the uint packed_color",
    ),
    "harmonics of others": (
        "a.ply",
        lambda b: swapped(b.compressed_ply(300, 1), b"element sh 300", b"element sh 299"),
        "300 Gaussians but harmonics for 299",
    ),
    "compressed cut": ("a.ply", lambda b: b.compressed_ply(300, 0)[:-1], "the file has 4,799"),
    "compressed text": (
        "a.ply",
        lambda b: swapped(b.compressed_ply(3, 0), b"binary_little_endian", b"ascii"),
        "cannot be text",
    ),
    "splat of odd size": ("a.splat", lambda b: bytes(33), "no multiple"),
    "splat of negative scales": (
        "a.splat",
        lambda b: np.full(8, -1, "<f4").tobytes(),
        "Gaussian 0 has a negative scale",
    ),
    "gzip of something": ("a.spz", lambda b: gzip.compress(b"hello" * 10), "no .spz inside"),
    "gzip cut": ("a.spz", lambda b: b.spz(3)[0][:-9], "damaged or ends too early"),
    "gzip damaged": ("a.spz", lambda b: b.spz(3)[0][:-8] + bytes(8), "damaged"),
    "gzip header alone": ("a.spz", lambda b: b"\x1f\x8b\x08", "damaged"),
    "spz count lies": (
        "a.spz",
        lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 6, 0, 12, 0))[0],
        "claims 6 Gaussians of 120 bytes, the file holds 100",
    ),
    "spz count lies grossly": (
        "a.spz",
        lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 4_000_000_000, 0, 12, 0))[0],
        r"its 4,000,000,000 Gaussians would take 1,104\.0 GB",
    ),
    "spz count is a bomb": (
        "a.spz",
        lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 60_000_000, 0, 12, 0))[0],
        r"its 60,000,000 Gaussians would take 16\.6 GB of memory, which its \d+ bytes cannot honestly mean",
    ),
    "spz of none": ("a.spz", lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 0, 0, 12, 0))[0], "declares 0 Gaussians"),
    "spz version": ("a.spz", lambda b: b.spz(3, 5, 0, head=(b"NGSP", 9, 5, 0, 12, 0))[0], "version 9 is unknown"),
    "spz degree": ("a.spz", lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 5, 7, 12, 0))[0], "degree 7"),
    "spz bits": ("a.spz", lambda b: b.spz(3, 5, 0, head=(b"NGSP", 3, 5, 0, 99, 0))[0], "99 fractional bits"),
    "spz 4 header cut": ("a.spz", lambda b: b.spz(4)[0][:20], "within its header"),
    "spz 4 cut": ("a.spz", lambda b: b.spz(4)[0][:-1], "does not fit"),
    "spz 4 table": ("a.spz", lambda b: b.spz(4, cut=8)[0], "does not fit"),
    "spz 4 count lies": (
        "a.spz",
        lambda b: b.spz(4, 5, 0, head=(b"NGSP", 4, 6, 0, 12, 0))[0],
        "does not fit the 6 Gaussians",
    ),
    "spz 4 stream": ("a.spz", lambda b: spoiled_zstd(b.spz(4, 5, 0)[0]), "is damaged"),
    "spz 4 bomb": ("a.spz", lambda b: zstd_bomb(b), "would unpack to 50,000,000 bytes, not 45"),
    "zip cut": ("a.sog", lambda b: b.zipped(b.sog(2))[:-30], "no|truncated"),
    "zip of something": ("a.sog", lambda b: b.zipped({"a.txt": b"x"}), r"holds 0 files meta\.json"),
    "zip of two": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "other/meta.json": b"{}"}),
        r"holds 2 files meta\.json",
    ),
    "zip without an image": (
        "a.sog",
        lambda b: b.zipped({k: v for k, v in b.sog(2).items() if k != "quats.webp"}),
        "holds 0 files 'quats.webp'",
    ),
    "zip damaged": ("a.sog", lambda b: spoiled_member(b), "cannot be unpacked"),
    "zip packed otherwise": ("a.sog", lambda b: b.zipped(b.sog(2), zipfile.ZIP_LZMA), "unusual way"),
    "zip bomb in meta": ("a.sog", lambda b: zip_bomb("meta.json"), "unpacks to more than"),
    "zip bomb in an image": ("a.sog", lambda b: zip_bomb("means_l.webp", b.sog(2)), "unpacks to more than"),
    "path upwards": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2, quats__files=["../quats.webp"]), "../quats.webp": b"x"}),
        "outside the splat",
    ),
    "absolute path": ("a.sog", lambda b: b.zipped(b.sog(2, quats__files=["/etc/passwd"])), "outside the splat"),
    "drive": ("a.sog", lambda b: b.zipped(b.sog(2, quats__files=["c:quats.webp"])), "outside the splat"),
    "not json": ("a.sog", lambda b: b.zipped(meta_with(b.sog(2), b"{not json")), r"meta\.json cannot be read"),
    "not text": ("a.sog", lambda b: b.zipped(meta_with(b.sog(2), b"\xff\xfe\x00")), r"meta\.json cannot be read"),
    "json too deep": ("a.sog", lambda b: b.zipped(meta_with(b.sog(2), b"[" * 200_000)), "nested too deep"),
    "json list": ("a.sog", lambda b: b.zipped(meta_with(b.sog(2), b"[]")), "holds no object"),
    "json key twice": ("a.sog", lambda b: b.zipped(meta_with(b.sog(2), b'{"version": 2, "version": 2}')), "twice"),
    "json NaN": ("a.sog", lambda b: b.zipped(b.sog(2, means__mins=[float("nan"), 0, 0])), "NaN is no number"),
    "json infinity": (
        "a.sog",
        lambda b: b.zipped(meta_with(b.sog(2), swapped(b.sog(2)["meta.json"], b"-2.0", b"-2e999"))),
        r"for means\.mins, where a list of 3 numbers belongs",
    ),
    "levels of detail": ("a.sog", lambda b: b.zipped(b.sog(2, lodLevels=7)), "levels of detail"),
    "sog version": ("a.sog", lambda b: b.zipped(b.sog(2, version=3)), "unknown version"),
    "sog version true": ("a.sog", lambda b: b.zipped(b.sog(2, version=True)), "unknown version"),
    "count text": ("a.sog", lambda b: b.zipped(b.sog(2, count="10")), "for count, where a whole number belongs"),
    "count negative": ("a.sog", lambda b: b.zipped(b.sog(2, count=-1)), "where a whole number belongs"),
    "count real": ("a.sog", lambda b: b.zipped(b.sog(2, count=1.5)), "where a whole number belongs"),
    "sog count lies": ("a.sog", lambda b: b.zipped(b.sog(2, count=17)), "has 16 pixels for 17 Gaussians"),
    "sog count is a bomb": ("a.sog", lambda b: b.zipped(b.sog(2, count=60_000_000)), "cannot honestly mean"),
    "sog count absurd": ("a.sog", lambda b: b.zipped(b.sog(2, count=10**4000)), "more Gaussians than any"),
    "sog of none": ("a.sog", lambda b: b.zipped(b.sog(2, count=0)), "declares 0 Gaussians"),
    "shape empty": ("a.sog", lambda b: b.zipped(b.sog(1, means__shape=[])), "list of whole numbers"),
    "means missing": ("a.sog", lambda b: b.zipped(b.sog(2, means=None)), "nothing for means, where an object"),
    "means a list": ("a.sog", lambda b: b.zipped(b.sog(2, means=[1])), "for means, where an object belongs"),
    "two bounds": ("a.sog", lambda b: b.zipped(b.sog(2, means__maxs=[1, 2])), "a list of 3 numbers"),
    "one file for two": ("a.sog", lambda b: b.zipped(b.sog(2, means__files=["means_l.webp"])), "list of 2 file names"),
    "codebook short": ("a.sog", lambda b: b.zipped(b.sog(2, sh0__codebook=[0.0] * 255)), "list of 256 numbers"),
    "codebook of text": ("a.sog", lambda b: b.zipped(b.sog(2, sh0__codebook=["0"] * 256)), "list of 256 numbers"),
    "codebook of null": ("a.sog", lambda b: b.zipped(b.sog(2, sh0__codebook=[None] * 256)), "list of 256 numbers"),
    "codebook beyond": ("a.sog", lambda b: b.zipped(b.sog(2, sh0__codebook=[10**400] * 256)), "list of 256 numbers"),
    "bands lie": ("a.sog", lambda b: b.zipped(b.sog(2, shN__bands=2)), "not that of the bands"),
    "palette width": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "shN_centroids.webp": b.webp(np.zeros((2, 64, 3), np.uint8))}),
        "palettes are 192, 512 or 960",
    ),
    "label beyond the palette": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "shN_labels.webp": b.webp(np.full((4, 4, 3), 200, np.uint8))}),
        "names row 51,400 of a palette of 128",
    ),
    "rotation without a largest": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "quats.webp": b.webp(np.full((4, 4, 4), 200, np.uint8))}),
        "names no largest component",
    ),
    "image is no image": ("a.sog", lambda b: b.zipped({**b.sog(2), "sh0.webp": b"RIFF"}), "'sh0.webp' is no WebP"),
    "image cut": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "quats.webp": b.sog(2)["quats.webp"][:40]}),
        "'quats.webp' cannot be decoded",
    ),
    "image is lossy": ("a.sog", lambda b: b.zipped({**b.sog(2), "sh0.webp": lossy()}), "is lossy"),
    "image is huge": ("a.sog", lambda b: b.zipped({**b.sog(2), "sh0.webp": huge(b)}), "16384 x 16384 pixels"),
    "canvas is huge": (
        "a.sog",
        lambda b: b.zipped({**b.sog(2), "sh0.webp": b"RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0" + b"\xff" * 6}),
        "16777216 x 16777216 pixels",
    ),
}


def spoiled_zstd(content):
    streams = content[15]
    start = 32 + 16 * streams
    # The block's own header: magic, descriptor and size take six bytes.
    return content[: start + 6] + bytes(b ^ 0xFF for b in content[start + 6 : start + 9]) + content[start + 9 :]


def zstd_bomb(build):
    """The first stream replaced by one of 50 MB of zeros in a few kilobytes, its table still saying 45 bytes."""
    from numcodecs import Zstd

    content, _ = build.spz(4, 5, 0)
    streams = content[15]
    bomb = Zstd(level=1).encode(bytes(50_000_000))
    (old,) = struct.unpack_from("<Q", content, 32)
    start = 32 + 16 * streams
    return content[:32] + struct.pack("<Q", len(bomb)) + content[40:start] + bomb + content[start + old :]


def spoiled_member(build):
    files = build.sog(2)
    content = build.zipped(files)
    place = content.index(files["scales.webp"]) + 10
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


def zip_bomb(name, files=None):
    """A member of 1 GB of zeros in a megabyte."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for other, content in (files or {}).items():
            if other != name:
                archive.writestr(other, content)
        with archive.open(name, "w") as member:
            for _ in range(100):
                member.write(bytes(1_000_000))
    return stream.getvalue()


def lossy():
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.zeros((16, 16, 3), np.uint8)).save(stream, "WEBP", quality=50)
    return stream.getvalue()


def huge(build):
    content = bytearray(build.webp(np.zeros((4, 4, 4), np.uint8)))
    place = content.index(b"VP8L") + 9
    content[place : place + 4] = (0x3FFF | (0x3FFF << 14)).to_bytes(4, "little")
    return bytes(content)


@pytest.mark.parametrize("case", CASES)
def test_bad_files_are_refused_in_one_line(build, tmp_path, case):
    import re

    name, content, says = CASES[case]
    path = tmp_path / name
    path.write_bytes(content(build))
    size = path.stat().st_size
    tracemalloc.start()
    try:
        text = refusal(read_splat, path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert re.search(says, text), text
    # What a bomb may cost: its own size a few times, and the harmless allowance of an image or meta.json.
    assert peak < 10 * size + (96 << 20)
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_places_that_are_no_splat(build, tmp_path):
    assert "No such file" in refusal(read_splat, tmp_path / "missing.ply")
    assert "null character" in refusal(read_splat, f"{tmp_path}/a\0b.ply")
    assert "without meta.json" in refusal(read_splat, tmp_path)
    (tmp_path / "other.json").write_text(json.dumps({"count": 7}))
    assert "is no splat" in refusal(read_splat, tmp_path / "other.json")
    assert "without meta.json" in refusal(read_splat, tmp_path)
    os.mkfifo(tmp_path / "pipe.ply")
    assert "no ordinary file" in refusal(read_splat, tmp_path / "pipe.ply")
    loop = tmp_path / "loop.ply"
    loop.symlink_to(loop)
    assert "symbolic links" in refusal(read_splat, loop)
    odd = tmp_path / "a\nb.ply"
    with pytest.raises(SplatFormatError) as error:
        read_splat(odd)
    assert "\n" not in str(error.value)


def test_folders_of_a_sog(build, tmp_path):
    files = build.sog(2)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "quats.webp").unlink()
    assert "holds no file 'quats.webp'" in refusal(read_splat, tmp_path)
    (tmp_path / "quats.webp").mkdir()
    assert "holds no file 'quats.webp'" in refusal(read_splat, tmp_path)


def test_inspect_refuses_as_reading_does(tmp_path):
    assert "No such file" in refusal(inspect_splat, tmp_path / "missing.ply")


@pytest.fixture(scope="session")
def samples(build, some, tmp_path_factory):
    """Small good files of every kind."""
    folder = tmp_path_factory.mktemp("samples")
    for suffix in (".ply", ".splat", ".spz"):
        write_splat(folder / f"a{suffix}", some(5, 1))
    content = {path.name: path.read_bytes() for path in folder.iterdir()}
    content["old.ply"] = build.compressed_ply(5, 1, old=True)
    content["new.ply"] = build.compressed_ply(5, 1)
    content["text.ply"] = inria(build, order="")
    for version in (1, 2, 4):
        content[f"v{version}.spz"] = build.spz(version, 5, 1)[0]
    for version in (1, 2):
        content[f"v{version}.sog"] = build.zipped(build.sog(version))
    content["a.glb"] = build.cloud_glb(5, 1, nodes=[{"children": [1], "scale": [1, 2, 3]}, {"mesh": 0}])
    return content


@pytest.fixture(scope="session")
def sogs(build):
    return {version: build.sog(version) for version in (1, 2)}


NAMES = [
    *("a.ply", "a.splat", "a.spz", "old.ply", "new.ply", "text.ply"),
    *("v1.spz", "v2.spz", "v4.spz", "v1.sog", "v2.sog", "a.glb"),
]


def gaussians_or_refusal(path):
    """Either is right; anything else is raised and fails the test."""
    try:
        gaussians = read_splat(path)
    except SplatFormatError as error:
        assert str(error).isprintable()
        return
    assert isinstance(gaussians, Gaussians)
    assert len(gaussians) > 0
    inspect_splat(path).to_text()
    json.dumps(inspect_splat(path).to_json(), allow_nan=False)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_damage_gives_gaussians_or_a_refusal(samples, tmp_path, name, data):
    content = bytearray(samples[name])
    flips = data.draw(st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255)), max_size=6))
    for place, value in flips:
        content[place] = value
    cut = data.draw(st.one_of(st.none(), st.integers(0, len(content))))
    path = tmp_path / name
    path.write_bytes(bytes(content[:cut]))
    gaussians_or_refusal(path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("version", [1, 2])
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_damage_behind_the_checksums_of_a_sog(sogs, tmp_path, version, data):
    """In a folder no checksum stands before the images and meta.json."""
    files = dict(sogs[version])
    name = data.draw(st.sampled_from(sorted(files)))
    content = bytearray(files[name])
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    files[name] = bytes(content[: data.draw(st.one_of(st.none(), st.integers(0, len(content))))])
    folder = tmp_path / "splat"
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    gaussians_or_refusal(folder)


@pytest.mark.filterwarnings("error")
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_damage_behind_the_checksum_of_a_spz(build, tmp_path, data):
    """Packed again after the damage, so that gzip finds nothing wrong."""
    content = bytearray(zlib.decompress(build.spz(data.draw(st.integers(1, 3)), 5, 1)[0], wbits=31))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, 40))] = data.draw(st.integers(0, 255))
    path = tmp_path / "a.spz"
    path.write_bytes(gzip.compress(bytes(content)))
    gaussians_or_refusal(path)
