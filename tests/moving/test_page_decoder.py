"""The decoder of the page, written from the format's description alone, against the one in Python."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import gasp_core.moving
from gasp_core import MovingSplat, pack
from gasp_core.games import polar_rotations
from gasp_core.gaussians import rotation_matrices

DECODER = Path(gasp_core.moving.__file__).parent / "page" / "decoder.js"


@pytest.fixture
def node():
    """node(script, ...) runs a script beside this file, which is given the decoder first of all."""
    program = shutil.which("node")
    if program is None:
        # It comes with no Python package; test_page.py runs the same decoder in a browser, which CI installs.
        pytest.skip("no node here, which runs what browsers run")

    def run(script, *arguments):
        command = [program, Path(__file__).parent / script, DECODER, *arguments]
        done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    return run


@pytest.fixture
def decoded(node, tmp_path):
    """decoded(splat, frames) -> places, edges and gradients of frames, as a browser has them."""

    def run(splat, frames):
        rest = splat.reference
        arrays = (rest.means, rotation_matrices(rest.quaternions), rest.scales)
        (tmp_path / "rest").write_bytes(b"".join(array.astype("<f4").tobytes() for array in arrays))
        node("decode.mjs", splat.path, tmp_path / "rest", tmp_path / "out", *frames)
        found = np.frombuffer((tmp_path / "out").read_bytes(), "<f4").reshape(len(frames), -1)
        count = len(rest)
        return [
            (row[: 3 * count].reshape(-1, 3), row[3 * count : 12 * count].reshape(-1, 3, 3), row[12 * count :])
            for row in found
        ]

    return run


@pytest.mark.parametrize("way", ["all", "cores", "levels", "frames", "volume"])
def test_both_decoders_agree(recorded, ways, decoded, tmp_path, way):
    pack(recorded(ways[way][1]), tmp_path / "a.sog")
    splat = MovingSplat.open(tmp_path / "a.sog")
    frames = [len(splat) - 1, 1, 0]
    size = np.abs(splat.reference.means).max()
    for frame, (places, edges, gradients) in zip(frames, decoded(splat, frames)):
        for rows, simplices in splat.simplices(frame):
            wanted = (simplices[:, 1:] - simplices[:, :1]).transpose(0, 2, 1)
            # float32 of places, and of what is rest for one and float64 for the other.
            assert np.abs(places[rows] - simplices[:, 0]).max() <= 8 * 2.0**-24 * size
            lengths = splat.reference.scales[rows].max(axis=1)
            assert (np.abs(edges[rows] - wanted).max(axis=(1, 2)) / lengths).max() <= 1e-4
            axes = rotation_matrices(splat.reference.quaternions[rows])
            carried = gradients.reshape(-1, 3, 3)[rows] @ axes * splat.reference.scales[rows][:, None, :]
            # Turns are those of the maps, without corrections of a few.
            assert np.percentile(np.abs(carried - wanted).max(axis=(1, 2)) / lengths, 90) <= 1e-3


def test_both_decoders_correct_alike(recorded, ways, decoded, tmp_path, monkeypatch):
    """Some in a frame, and others in the next, which goes on from them."""
    monkeypatch.setattr("gasp_core.moving.bodies._AXES_MAY_BE_OFF", 1 / 256)
    pack(recorded(ways["volume"][1]), tmp_path / "a.sog")
    splat = MovingSplat.open(tmp_path / "a.sog")
    frames = [*range(len(splat))]
    size = np.abs(splat.reference.means).max()
    corrected = []
    for frame, (places, edges, _) in zip(frames, decoded(splat, frames)):
        ((rows, simplices),) = splat.simplices(frame)
        corrected.append(len(splat._at[1][0].corrections.rows))
        assert np.abs(places[rows] - simplices[:, 0]).max() <= 8 * 2.0**-24 * size
        wanted = (simplices[:, 1:] - simplices[:, :1]).transpose(0, 2, 1)
        lengths = splat.reference.scales[rows].max(axis=1)
        assert (np.abs(edges[rows] - wanted).max(axis=(1, 2)) / lengths).max() <= 1e-4
    assert len(set(corrected)) > 2 and min(corrected[1:]) > 0


def test_rotations_of_any_matrix(node, tmp_path):
    """Of what is inside out too: torn matter is."""
    rng = np.random.default_rng(0)
    matrices = np.concatenate([rng.normal(size=(300, 3, 3)), np.eye(3) + 0.3 * rng.normal(size=(100, 3, 3))])
    assert (np.linalg.det(matrices) < 0).any()
    (tmp_path / "matrices").write_bytes(matrices.astype("<f8").tobytes())
    node("rotate.mjs", tmp_path / "matrices", tmp_path / "out")
    found = np.frombuffer((tmp_path / "out").read_bytes(), "<f8").reshape(-1, 3, 3)
    # Half of what the singular values differ by, or add up to, decides how far rounding is magnified.
    np.testing.assert_allclose(found, polar_rotations(matrices), atol=1e-9)
