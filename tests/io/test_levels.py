"""Streamed SOG: levels of detail in chunks, put together; and indices that lie."""

import json

import numpy as np
import pytest

from gasp_core.errors import SplatFormatError
from gasp_core.io import read_splat, write_splat
from gasp_core.io.sog_levels import level_counts


@pytest.fixture
def streamed(build, tmp_path):
    """streamed(**changes) -> the index of two levels, the finer in two chunks of which leaves share one."""

    def make(**changes):
        chunks = {"0_0": build.sog(2, 30, 1, seed=1), "0_1": build.sog(2, 7, 2, seed=2), "1_0": build.sog(2, 9, 0)}
        for name, files in chunks.items():
            (tmp_path / name).mkdir(exist_ok=True)
            for file, content in files.items():
                (tmp_path / name / file).write_bytes(content)

        def leaf(**lods):
            return {"lods": {level[1:]: dict(zip(("file", "offset", "count"), run)) for level, run in lods.items()}}

        index = {
            "version": 1,
            "lodLevels": 2,
            "filenames": [f"{name}/meta.json" for name in chunks],
            "tree": {
                "children": [
                    leaf(_0=(0, 20, 10), _1=(2, 4, 5)),
                    {"children": [leaf(_0=(0, 0, 20), _1=(2, 0, 4)), leaf(_0=(1, 0, 7))]},
                ]
            },
        }
        (tmp_path / "lod-meta.json").write_text(json.dumps(index | changes))
        return tmp_path / "lod-meta.json"

    return make


def test_a_level_is_all_of_its_chunks(streamed):
    index = streamed()
    assert level_counts(index) == (37, 9)
    finest = read_splat(index)
    first, second = read_splat(index.parent / "0_0"), read_splat(index.parent / "0_1")
    assert (len(finest), finest.sh_degree) == (37, 2)
    for name in ("means", "quaternions", "scales", "opacities"):
        both = np.concatenate([getattr(first, name), getattr(second, name)])
        np.testing.assert_array_equal(getattr(finest, name), both)
    np.testing.assert_array_equal(finest.harmonics[:30, :4], first.harmonics)
    np.testing.assert_array_equal(finest.harmonics[:30, 4:], 0)
    np.testing.assert_array_equal(finest.harmonics[30:], second.harmonics)
    coarse = read_splat(index.parent, level=1)
    np.testing.assert_array_equal(coarse.means, read_splat(index.parent / "1_0").means)


@pytest.mark.parametrize("version", [None, 1])
def test_indices_of_before_there_was_a_version(streamed, version):
    index = streamed(environment=None, version=version)
    if version is None:
        index.write_text(index.read_text().replace('"version": null, ', ""))
    assert len(read_splat(index)) == 37


LEAF = {"lods": {"0": {"file": 0, "offset": 0, "count": 30}}}
NEST = LEAF
for _ in range(101):
    NEST = {"children": [NEST]}


@pytest.mark.parametrize(
    ("changes", "level", "told"),
    [
        ({}, 2, "levels 0 to 1, not 2"),
        ({"version": 2}, 0, "unknown version"),
        ({"lodLevels": 0}, 0, "from 1 to 100"),
        ({"lodLevels": 3}, 2, "level 2 is empty"),
        ({"lodLevels": 1}, 0, "a level '1'"),
        ({"filenames": ["0_0/meta.json"]}, 0, "names file 1 of 1"),
        ({"filenames": ["../0_0/meta.json"] * 3}, 0, "no meta.json below"),
        ({"filenames": ["/0_0/meta.json"] * 3}, 0, "no meta.json below"),
        ({"filenames": ["C:/0_0/meta.json"] * 3}, 0, "no meta.json below"),
        ({"filenames": ["0_0/secret.txt"] * 3}, 0, "no meta.json below"),
        ({"filenames": [4, 5, 6]}, 0, "no meta.json below"),
        ({"filenames": ["gone/meta.json"] * 3}, 0, "has lost its file"),
        ({"tree": LEAF["lods"]}, 0, "tree.children"),
        ({"tree": {"children": []}}, 0, "a list of objects"),
        ({"tree": {"children": [3]}}, 0, "a list of objects"),
        ({"tree": NEST}, 0, "100 nodes deep"),
        ({"tree": {"children": [LEAF, LEAF]}}, 0, "share out"),
        ({"tree": {"lods": {"0": {"file": 0, "offset": 0, "count": 29}}}}, 0, "share out"),
        ({"tree": {"lods": {"0": {"file": 0, "offset": 1, "count": 29}}}}, 0, "share out"),
        ({"tree": {"lods": {"0": {"file": 0, "offset": 0, "count": 10**19}}}}, 0, "more Gaussians than"),
        ({"tree": {"lods": {"0": {"file": 0, "offset": 0, "count": 10**8}}}}, 0, "cannot honestly mean"),
        ({"tree": {"lods": {"0": {"file": 0, "offset": -1, "count": 30}}}}, 0, "a whole number"),
        ({"tree": {"lods": {"fine": {}}}}, 0, "a level 'fine'"),
    ],
)
def test_indices_that_lie(streamed, changes, level, told):
    index = streamed(**changes)
    with pytest.raises(SplatFormatError) as refused:
        read_splat(index, level=level)
    assert told in str(refused.value)
    assert str(index) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_no_index(streamed, tmp_path):
    index = streamed()
    for content in (b"", b"[]", b"{", b'{"a": 1, "a": 2}', b"[" * 100_000, b"\xff"):
        index.write_bytes(content)
        with pytest.raises(SplatFormatError):
            read_splat(index)
    index.unlink()
    with pytest.raises(SplatFormatError):
        read_splat(index)


def test_other_files_have_one_level(some, tmp_path):
    write_splat(tmp_path / "a.ply", some(5, 0))
    with pytest.raises(SplatFormatError, match="of one level, there is no level 1"):
        read_splat(tmp_path / "a.ply", level=1)


def test_a_real_set(data_folder):
    """Robot of seven levels: two leaves share every chunk; the counts are those of its levels."""
    folder = data_folder / "splats/playbot"
    assert level_counts(folder) == (500_000, 250_000, 125_000, 31_000, 8_406, 3_000, 1_873)
    np.testing.assert_array_equal(read_splat(folder, level=3).means, read_splat(folder / "3_0").means)
    assert len(read_splat(folder / "lod-meta.json", level=6)) == 1_873
