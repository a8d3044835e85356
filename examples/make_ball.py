"""Write the splat of soft_drop.toml: a ball that is filled with round Gaussians, unlike captures, which are hollow.

python examples/make_ball.py
"""

from pathlib import Path

import numpy as np

import gasp_core as gasp

ACROSS = 26  # Gaussians along the diameter

axis = (np.arange(ACROSS) + 0.5) / ACROSS - 0.5
points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
points = points[np.linalg.norm(points, axis=1) < 0.5]
band = np.floor(6 * points[:, 2]) % 2
ball = gasp.Gaussians(
    means=points,
    quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (len(points), 1)),
    # Half the distance to the next: vertices and centres fill the ball evenly.
    scales=np.full((len(points), 3), 0.5 / ACROSS),
    opacities=np.full(len(points), 0.9),
    harmonics=np.stack([0.9 - 0.6 * band, 0.2 + 0.5 * band, 0.2 + 0.2 * band], axis=1)[:, None] - 0.5,
)
path = Path(__file__).with_name("ball.ply")
gasp.write_splat(path, ball)
print(f"wrote {path}, {len(points)} Gaussians; now: gasp run {path.with_name('soft_drop.toml')}")
