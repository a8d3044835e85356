"""Recordings at addresses, by the commands that read them."""

import pytest
from object_store import object_store

from gasp_core.cli.main import main


@pytest.fixture(scope="module")
def bucket():
    with object_store() as address:
        yield address


@pytest.fixture
def run(gasp, installed, workplace, bucket, monkeypatch):
    """A run at an address; what is left of it here is gone."""
    installed("ballistic")
    monkeypatch.setenv("GASP_CACHE", str(workplace / "cache"))
    address = f"{bucket}/{workplace.name}/toy.gasp"
    made = gasp("run", "scene.toml", "--out", address)
    assert made.status == 0, made.err
    assert f"gasp render {address}" in made.out
    monkeypatch.setenv("GASP_CACHE", str(workplace / "another machine"))
    return address


@pytest.mark.thorough
def test_it_is_verified_exported_drawn_and_packed(gasp, run, workplace):
    pytest.importorskip("gasp_renderer")
    verified = gasp("verify", run)
    assert verified.status == 0 and f"{run}: whole, 3 frames" in verified.out
    assert gasp("export", run, "--frame", "2", "-o", "last.ply").status == 0
    assert gasp("render", run, "-o", "sheet.png", "--size", "64").status == 0
    assert gasp("pack", run).status == 0
    assert {"last.ply", "sheet.png", "toy.moving.sog"} <= {path.name for path in workplace.iterdir()}


def test_it_is_gone_on_with_and_a_reference(gasp, run):
    assert gasp("run", "scene.toml", "--out", run).status == 2
    again = gasp("run", "scene.toml", "--out", run, "--resume")
    assert again.status == 0 and "3 frames, complete" in again.out
    swept = gasp("sweep", "scene.toml", "--set", "scene.gravity=[0,0,-9.81]", "--reference", run, "--json")
    assert swept.status == 0 and '"rms_share": 0.0' in swept.out


@pytest.mark.parametrize("command", ["verify", "render", "export", "pack"])
def test_what_is_not_there_is_one_line(bucket, tmp_path, monkeypatch, capsys, command):
    monkeypatch.setenv("GASP_CACHE", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert main([command, f"{bucket}/none.gasp"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"{bucket}/none.gasp: there is no such recording" in error


@pytest.mark.parametrize(
    "command",
    [
        ["inspect", "s3://bucket/toy.ply"],
        ["convert", "toy.ply", "s3://bucket/toy.splat"],
        ["run", "scene.toml", "--render", "s3://bucket/film.mp4"],
        ["compare", "scene.toml", "--engines", "ballistic", "--out", "gs://bucket/both"],
        ["sweep", "s3://bucket/scene.toml", "--set", "scene.duration=1"],
        ["soup", "export", "toy.ply", "-o", "s3://bucket/soup.ply"],
    ],
    ids=lambda command: command[0],
)
def test_what_is_no_recording_is_on_this_machine(workplace, refused, command):
    """Not in a folder called "s3:"."""
    refused(*command, says=["is an address, and only recordings can be at one"])
    assert not list(workplace.glob("*:"))


def test_a_file_has_an_address_too(gasp, workplace):
    assert gasp("convert", (workplace / "toy.ply").as_uri(), (workplace / "other.splat").as_uri()).status == 0
    assert (workplace / "other.splat").is_file()
