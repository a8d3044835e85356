"""Small files that would take gigabytes: refused before anything is unpacked, unless somebody allows it."""

import io
import json
import os
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from gasp_core import memory_limit
from gasp_core.cli.main import main
from gasp_core.errors import GaspError, SplatFormatError
from gasp_core.io import read_splat
from gasp_core.io.memory_limit import VARIABLE, memory_of

MEGABYTE = 1 << 20
SMALL = 64 * MEGABYTE
"""Of a file of some kilobytes."""

READ = """
import pathlib, resource, sys
import numcodecs, PIL.Image, PIL.WebPImagePlugin, psutil
import gasp_core.io.compressed_ply, gasp_core.io.detect, gasp_core.io.inria, gasp_core.io.sog, gasp_core.io.spz
from gasp_core.errors import SplatFormatError

def peak():
    # Not ru_maxrss: it is never below that of the process which started this one.
    status = pathlib.Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024

# What is not refused must not take the machine with it.
resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
before = peak()
try:
    print("read", len(gasp_core.io.detect.read(sys.argv[1])[0]))
except SplatFormatError as error:
    print("refused", error)
print(peak() - before)
"""


needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux's /proc")


def peak_of(path):
    """What a process of its own made of a file, and by how many bytes it grew."""
    done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True)
    *said, peak = done.stdout.splitlines()
    assert len(said) == 1
    return said[0], int(peak)


def even(side, pixel):
    """A WebP of one colour, a few hundred bytes whatever its size."""
    from PIL import Image

    stream = io.BytesIO()
    picture = Image.new("RGB" if len(pixel) == 3 else "RGBA", (side, side), pixel)
    picture.save(stream, "WEBP", lossless=True, exact=True, quality=0, method=0)
    return stream.getvalue()


def sog_of_even_images(build, version, side):
    files = build.sog(version, 10, 3)
    meta = json.loads(files["meta.json"])
    if version == 2:
        meta["count"] = side * side
    else:
        meta["means"]["shape"] = [side * side, 3]
    rgb, rgba = even(side, (1, 2, 3)), even(side, (1, 2, 3, 254))
    files |= {"means_l.webp": rgb, "means_u.webp": rgb, "scales.webp": rgb, "sh0.webp": rgba, "quats.webp": rgba}
    files |= {"shN_labels.webp": even(side, (0, 0, 0)), "meta.json": json.dumps(meta).encode()}
    return build.zipped(files, zipfile.ZIP_DEFLATED)


def sog_of_long_meta(build):
    return build.zipped({**build.sog(2), "meta.json": b'{"a":[' + b"{}," * 5_000_000 + b"0]}"}, zipfile.ZIP_DEFLATED)


def spz_of_zeros(count, degree, row):
    packer = zlib.compressobj(9, wbits=31)
    content = packer.compress(struct.pack("<4sIIBBBB", b"NGSP", 3, count, degree, 12, 0, 0))
    block = bytes(row * 1000)
    for _ in range(count // 1000):
        content += packer.compress(block)
    return content + packer.flush()


def spz_4_of_zeros(count):
    from numcodecs import Zstd

    sizes = [9 * count, count, 3 * count, 3 * count, 4 * count, 45 * count]
    packed = [Zstd(level=1).encode(bytes(size)) for size in sizes]
    table = b"".join(struct.pack("<QQ", len(part), size) for part, size in zip(packed, sizes))
    head = struct.pack("<4sIIBBBBI12x", b"NGSP", 4, count, 3, 12, 0, len(packed), 32)
    return head + table + b"".join(packed)


def spz_4_of_unsaid_size(build):
    """Its first stream says no size, and repeats one byte 128 kB at a time, four bytes of file for each."""
    content, _ = build.spz(4, 5, 0)
    # RFC 8878: magic, a descriptor without a size, a window; then blocks of run length, the last one marked.
    block = ((1 << 17) << 3 | 1 << 1).to_bytes(3, "little") + b"\0"
    last = ((1 << 17) << 3 | 1 << 1 | 1).to_bytes(3, "little") + b"\0"
    frame = b"\x28\xb5\x2f\xfd\x00\x80" + block * 8000 + last
    (old,) = struct.unpack_from("<Q", content, 32)
    start = 32 + 16 * content[15]
    return content[:32] + struct.pack("<Q", len(frame)) + content[40:start] + frame + content[start + old :]


def ply_of(build, lines):
    names = "".join(f"property float {name}\n" for name in build.inria_names(0))
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex 1\n{names}{lines}end_header\n"
    return head.encode() + bytes(1 << 17)


BOMBS = {
    "even images.sog": lambda b: sog_of_even_images(b, 2, 3600),
    "even images of version 1.sog": lambda b: sog_of_even_images(b, 1, 3600),
    "images of two million.sog": lambda b: sog_of_even_images(b, 2, 1400),
    "long meta.sog": sog_of_long_meta,
    "one large image.sog": lambda b: b.zipped({**b.sog(2), "sh0.webp": even(2000, (1, 2, 3, 4))}),
    "zeros of degree 0.spz": lambda b: spz_of_zeros(13_000_000, 0, 20),
    "zeros of degree 3.spz": lambda b: spz_of_zeros(4_000_000, 3, 65),
    "zeros of version 4.spz": lambda b: spz_4_of_zeros(4_000_000),
    "unsaid size of version 4.spz": spz_4_of_unsaid_size,
    "elements.ply": lambda b: ply_of(b, "".join(f"element e{k} 0\n" for k in range(15_000))),
    "properties.ply": lambda b: ply_of(b, "".join(f"property char p{k}\n" for k in range(12_000))),
}


@needs_proc
@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_that_would_take_much_memory_is_refused(name, build, tmp_path):
    path = tmp_path / name
    path.write_bytes(BOMBS[name](build))
    assert path.stat().st_size < MEGABYTE
    said, peak = peak_of(path)
    assert said.startswith(f"refused {path}: ")
    assert peak < SMALL


@needs_proc
def test_the_largest_palette_beside_few_gaussians_takes_little(build, tmp_path):
    path = tmp_path / "a.sog"
    pixels = np.zeros((1024, 960, 3), np.uint8)
    path.write_bytes(build.zipped({**build.sog(2, 10, 3), "shN_centroids.webp": build.webp(pixels)}))
    said, peak = peak_of(path)
    assert said == "read 10"
    assert peak < SMALL


@needs_proc
def test_text_is_taken_apart_in_pieces(build, tmp_path):
    path = tmp_path / "a.ply"
    head = build.ply([(name, "float") for name in build.inria_names(0)], np.zeros((0, 14)), count=300_000, order="")
    content = head.rstrip(b"\n") + b"\n" + b"0 " * (14 * 300_000)
    path.write_bytes(content)
    said, peak = peak_of(path)
    assert said == "read 300000"
    # All words at once took 30 times the text; its numbers take 4 times, twice while they are joined, and the
    # Gaussians 7 times in this shortest of texts.
    assert peak < 20 * len(content)


def test_a_file_larger_than_what_the_machine_has_is_not_read(tmp_path):
    path = tmp_path / "a.ply"
    with path.open("wb") as stream:
        stream.write(b"ply\n")
        os.truncate(stream.fileno(), 1 << 43)
    with pytest.raises(SplatFormatError, match=r"8,796\.1 GB large, .* of memory may be taken"):
        read_splat(path)


@pytest.mark.parametrize("count", [0, 999, 1_000, 70_000])
def test_words_are_whole_wherever_a_piece_of_text_ends(build, tmp_path, read, count):
    """A word of the comment before shifts where the pieces end."""
    rows = np.random.default_rng(0).normal(size=(9_000, 14))
    content = build.ply([(name, "double") for name in build.inria_names(0)], rows, order="")
    assert len(content) > 2 * MEGABYTE
    place = content.index(b"end_header\n") + len(b"end_header\n")
    gaussians = read(content[:place] + b" " * count + content[place:], "a.ply")
    np.testing.assert_array_equal(gaussians.means, rows[:, :3])


class TestWhatIsAllowed:
    @pytest.fixture
    def steep(self, tmp_path):
        """A file that is packed a thousandfold, but honest: 200,000 Gaussians at one place."""
        path = tmp_path / "a.spz"
        path.write_bytes(spz_of_zeros(200_000, 0, 20))
        return path

    def test_is_read(self, steep):
        with pytest.raises(SplatFormatError, match=r"55 MB of memory, which its .* --most-memory or gasp_core\.io"):
            read_splat(steep)
        with memory_limit(memory_of(200_000, 1)):
            assert len(read_splat(steep)) == 200_000
        with pytest.raises(SplatFormatError):
            read_splat(steep)

    def test_is_a_limit_as_well(self, read, build):
        content = build.ply([(name, "float") for name in build.inria_names(0)], np.zeros((1000, 14)))
        with (
            memory_limit(memory_of(1000, 1) - 1),
            pytest.raises(SplatFormatError, match=r"0 MB are allowed; allow more"),
        ):
            read(content, "a.ply")
        with memory_limit(memory_of(1000, 1)):
            assert len(read(content, "a.ply")) == 1000

    def test_is_what_it_was_afterwards(self, monkeypatch):
        monkeypatch.setenv(VARIABLE, "77")
        with memory_limit(5):
            assert os.environ[VARIABLE] == "5"
        assert os.environ[VARIABLE] == "77"

    @pytest.mark.parametrize("most", [0, -1])
    def test_is_something(self, most):
        with pytest.raises(GaspError, match="must be a number of bytes > 0"), memory_limit(most):
            pass

    @pytest.mark.parametrize("text", ["8G", "-1", "0", "٣", "9" * 5000])
    def test_is_a_number_in_the_environment(self, steep, monkeypatch, text):
        monkeypatch.setenv(VARIABLE, text)
        with pytest.raises(SplatFormatError, match=f"{VARIABLE} must be a number of bytes"):
            read_splat(steep)

    @pytest.mark.parametrize("size", ["60M", "0.06g", "60000K", "60 MB"])
    def test_has_a_flag(self, steep, capsys, size):
        assert main(["inspect", str(steep)]) == 2
        assert "--most-memory" in capsys.readouterr().err
        assert main(["inspect", str(steep), "--most-memory", size]) == 0
        assert "200,000 Gaussians" in capsys.readouterr().out
        assert VARIABLE not in os.environ

    @pytest.mark.parametrize(
        "command",
        [
            ["bind", "{splat}", "cage.obj", "moved.obj"],
            ["soup", "export", "{splat}"],
            ["soup", "import", "{splat}", "a.soup.ply", "moved.npy"],
            ["track", "{folder}"],
        ],
        ids=lambda command: " ".join(command[:2] if command[0] == "soup" else command[:1]),
    )
    def test_is_a_flag_of_every_command_whose_refusal_advises_it(self, steep, tmp_path, capsys, command):
        frames = tmp_path / "frames"
        frames.mkdir()
        for number in range(2):
            shutil.copy(steep, frames / f"{number}{steep.suffix}")
        words = [word.format(splat=steep, folder=frames) for word in command]
        assert main([*words, "--most-memory", "1K"]) == 2
        assert "allow more with --most-memory" in capsys.readouterr().err

    @pytest.mark.parametrize("size", ["", "0", "G", "1e9", "-5M", "nan", "9" * 5000, "٣G"])
    def test_is_said_as_a_size(self, steep, capsys, size):
        assert main(["inspect", str(steep), "--most-memory", size]) == 2
        assert "is no size; write 8G or 500M" in capsys.readouterr().err
