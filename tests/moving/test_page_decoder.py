"""The decoder of the page, written from the format's description alone, against the one in Python."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import gasp_core.moving
from gasp_core import MovingSplat, pack
from gasp_core.gaussians import rotation_matrices

DECODER = Path(gasp_core.moving.__file__).parent / "page" / "decoder.js"


@pytest.fixture
def decoded(tmp_path):
    """decoded(splat, frames) -> places, edges and gradients of frames, as a browser has them."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node here, which runs what browsers run")

    def run(splat, frames):
        rest = splat.reference
        arrays = (rest.means, rotation_matrices(rest.quaternions), rest.scales)
        (tmp_path / "rest").write_bytes(b"".join(array.astype("<f4").tobytes() for array in arrays))
        command = [node, Path(__file__).parent / "decode.mjs", DECODER, splat.path, tmp_path / "rest", tmp_path / "out"]
        done = subprocess.run([*map(str, command), *map(str, frames)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
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
