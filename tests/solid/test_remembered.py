"""Solids are kept, found again, and forgotten when there are too many."""

from __future__ import annotations

import copy
import dataclasses
import os
from collections import OrderedDict

import numpy as np
import pytest
from splat_shells import SHAPES, shell

from gasp_core.io.cache_folders import CACHE_VARIABLE, cache_folder
from gasp_core.solid import SolidOptions, solid_of
from gasp_core.solid import remembered as module
from gasp_core.solid.remembered import remembered


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "solids"


@pytest.fixture(autouse=True)
def _nothing_in_memory(monkeypatch):
    monkeypatch.setattr(module, "_last", OrderedDict())


def later(*arguments):
    """What another process is given: nothing is in its memory."""
    module._last.clear()
    return remembered(*arguments)


@pytest.fixture(scope="module")
def built():
    """Makes a solid, and copies of it from then on: whose turn it is to make one is what is looked at here."""
    kept = {}

    def build(gaussians, options=None):
        key = module._key(gaussians, options or SolidOptions())
        if key not in kept:
            kept[key] = solid_of(gaussians, options)
        return copy.deepcopy(kept[key])

    return build


@pytest.fixture(autouse=True)
def made(monkeypatch, built):
    """How often a solid was made."""
    count = []
    monkeypatch.setattr(module, "solid_of", lambda *arguments: count.append(0) or built(*arguments))
    return count


def same(first, second):
    for field in dataclasses.fields(first):
        one, other = getattr(first, field.name), getattr(second, field.name)
        if dataclasses.is_dataclass(one):
            same(one, other)
        else:
            assert np.array_equal(one, other), field.name


def splat(count=500):
    return shell(SHAPES["sphere"], count=count)


@pytest.mark.parametrize("options", [None, SolidOptions(interior="hollow", wall=0.01)])
def test_a_solid_is_made_once_and_found_again_as_it_was(folder, made, options):
    first, second = remembered(splat(), options), later(splat(), options)
    same(first, second)
    assert len(made) == 1 and len(list(folder.iterdir())) == 1


def test_other_gaussians_and_other_options_are_another_solid(folder, made):
    remembered(splat())
    remembered(splat(501))
    remembered(splat(), SolidOptions(cells=20))
    assert len(made) == 3


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 no archive", None])
def test_a_damaged_file_is_made_anew(folder, made, damage):
    first = remembered(splat())
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:-100] if damage is None else damage)
    same(first, later(splat()))
    assert len(made) == 2
    later(splat())
    assert len(made) == 2


def test_numbers_that_are_no_solid_are_made_anew(folder, made):
    remembered(splat())
    (file,) = folder.iterdir()
    with np.load(file) as kept:
        arrays = dict(kept)
    arrays["distance"] = np.full_like(arrays["distance"], np.nan)
    with file.open("wb") as stream:
        np.savez(stream, **arrays)
    assert np.isfinite(later(splat()).distance).all()
    assert len(made) == 2


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path, monkeypatch, made):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    assert remembered(splat()).volume > 0
    assert len(made) == 1


def test_nothing_is_kept_where_that_is_asked(tmp_path, monkeypatch, made):
    monkeypatch.setenv(CACHE_VARIABLE, "")
    assert cache_folder("solids") is None
    remembered(splat())
    later(splat())
    assert len(made) == 2


@pytest.mark.parametrize("cache", ["", "nowhere/that/can/be/written"])
def test_one_process_makes_a_solid_once_wherever_it_may_write(tmp_path, monkeypatch, made, cache):
    (tmp_path / "nowhere").write_text("no folder")
    monkeypatch.setenv(CACHE_VARIABLE, cache and str(tmp_path / cache))
    first = remembered(splat())
    assert remembered(splat()) is first and len(made) == 1
    with pytest.raises(ValueError, match="read-only"):
        first.distance[:] = 0


def test_of_those_in_memory_the_last_few_stay(folder, made):
    for count in (500, 501, 502, 503, 504):
        remembered(splat(count))
    assert len(module._last) == 4
    remembered(splat(501))
    remembered(splat(505))
    assert module._key(splat(501), SolidOptions()) in module._last
    assert module._key(splat(502), SolidOptions()) not in module._last


def test_the_oldest_go_and_nothing_else_does(folder, monkeypatch):
    for count in (500, 501, 502):
        remembered(splat(count))
    files = sorted(folder.iterdir())
    for age, file in enumerate(files):
        os.utime(file, (1e9 - age, 1e9 - age))
    (folder / "notes.txt").write_text("mine")
    # Room for three of the four there will be.
    monkeypatch.setattr(module, "_MOST_BYTES", 3.5 * max(file.stat().st_size for file in files))
    remembered(splat(503))
    assert set(files) - set(folder.iterdir()) == {files[-1]}
    assert (folder / "notes.txt").exists() and len(list(folder.iterdir())) == 4
