"""``gasp bind``, as it is run."""

import numpy as np
import pytest

from gasp_core.cli.main import main
from gasp_core.io import read_splat, write_splat
from gasp_core.toy import make_toy

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("igl")

TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture
def cage(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_splat("toy.ply", make_toy(64))
    box = trimesh.creation.box(extents=(0.6, 0.5, 1.1)).subdivide()
    box.apply_translation((0, 0, 0.5))
    box.export("cage.ply")
    bent = box.copy()
    bent.vertices = np.asarray(box.vertices) @ TURN.T + [0, 0, 1]
    bent.export("bent.ply")
    # The mesh as programs with +y up have it.
    upright = box.copy()
    upright.vertices = np.asarray(box.vertices) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    upright.export("upright.ply")
    upright.vertices = np.asarray(upright.vertices) + [0, 1, 0]
    upright.export("raised.ply")
    return box


def test_a_mesh_that_was_moved(cage, capsys):
    assert main(["bind", "toy.ply", "cage.ply", "bent.ply"]) == 0
    assert capsys.readouterr().out == "toy_moved.ply\n"
    still, found = read_splat("toy.ply"), read_splat("toy_moved.ply")
    np.testing.assert_allclose(found.means, still.means @ TURN.T + [0, 0, 1], atol=2e-6)
    expected = TURN @ still.covariances() @ TURN.T
    assert np.abs(found.covariances() - expected).max() < 1e-5 * np.abs(expected).max()


def test_a_mesh_that_lies_elsewhere_is_told_of(cage, capsys):
    """Its own, around it, is not: however far its faces are."""
    for mesh, told in (
        ("cage.ply", ""),
        ("upright.ply", "% of the diagonal of upright.ply outside of it: is it theirs"),
    ):
        assert main(["bind", "toy.ply", mesh, mesh, "--overwrite"]) == 0
        assert told in (said := capsys.readouterr().err) and bool(told) == bool(said)


def test_frames_and_another_up(cage, capsys):
    lifts = np.linspace(0, 1, 3)[:, None, None] * np.array([0, 0, 1.0])
    np.save("lifted.npy", np.asarray(cage.vertices) + lifts)
    assert main(["bind", "toy.ply", "cage.ply", "lifted.npy", "--format", "splat", "-o", "up"]) == 0
    assert capsys.readouterr().out == "up: 3 files, lifted_0000.splat to lifted_0002.splat\n"
    still = read_splat("toy.ply").means
    np.testing.assert_allclose(read_splat("up/lifted_0001.splat").means, still + [0, 0, 0.5], atol=2e-6)
    assert main(["bind", "toy.ply", "upright.ply", "raised.ply", "--mesh-up", "+y", "--up", "+z", "-o", "a.ply"]) == 0
    np.testing.assert_allclose(read_splat("a.ply").means, still + [0, 0, 1], atol=2e-6)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["toy.ply", "nowhere.obj", "bent.ply"], "nowhere.obj"),
        (["toy.ply", "cage.ply", "small.ply"], "has 8 vertices, the mesh has 26"),
        (["toy.ply", "cage.ply", "few.npy"], "is of shape (3, 3)"),
        (["toy.ply", "cage.ply", "none.npy"], "has no frame"),
        (["toy.ply", "cage.ply", "hole.npy"], "1 vertices are not finite, the first is 2 of frame 1"),
        (["toy.ply", "cage.ply", "bent.ply", "-o", "toy.ply", "--overwrite"], "toy.ply is what is read"),
        (["toy.ply", "cage.ply", "bent.ply", "bent.ply"], "two of MOVED have one name"),
        (["toy.ply", "cage.ply"], "Missing argument"),
        (["toy.ply", "toy.ply", "bent.ply"], "toy.ply"),
    ],
)
def test_refuses(cage, tmp_path, capsys, arguments, said):
    trimesh.creation.box().export("small.ply")
    np.save("none.npy", np.zeros((0, len(cage.vertices), 3)))
    np.save("few.npy", np.zeros((3, 3)))
    broken = np.tile(np.asarray(cage.vertices), (2, 1, 1))
    broken[1, 2, 0] = np.nan
    np.save("hole.npy", broken)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(["bind", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
