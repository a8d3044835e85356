"""A free bar that swings along itself, and where each of its points is at any time: something to measure engines by.

    python examples/vibrating_bar.py                 writes bar.ply, the splat of vibrating_bar.toml
    gasp run examples/vibrating_bar.toml --trust-code
    gasp tradeoff examples/vibrating_bar.toml --trust-code --truth examples/vibrating_bar.py:position

A bar of length L, free at both ends, without lateral contraction (Poisson's ratio 0), whose points start with the
velocity V cos(pi X / L), swings in its first longitudinal mode. For small amplitudes, and exactly for a fixed-corotated
material (whose first Piola-Kirchhoff stress is E (F - 1) along the bar), a point that is at X at rest is displaced by

    u(X, t) = A cos(pi X / L) sin(pi c t / L),    c = sqrt(E / rho),    V = pi A c / L
"""

from pathlib import Path

import numpy as np

LENGTH = 1.0  # m
DENSITY = 1000.0  # kg/m^3
YOUNGS_MODULUS = 1e4  # Pa
AMPLITUDE = 0.01  # m
SPEED_OF_SOUND = (YOUNGS_MODULUS / DENSITY) ** 0.5  # m/s: a period lasts 0.632 s

COUNT = 4001  # 4000 steps along the bar
WIDTH = LENGTH / 24  # m
SIZE = LENGTH / 60  # m, of a Gaussian: a quarter of a cell or more from 15 cells along the bar on


def position(points, time):
    """Where points (..., 3) [m] that are here at rest are at a time [s].

    The scene begins with the velocity it has at time 0, and it is the truth that runs are measured by.
    """
    moved = np.array(points)
    phase = np.pi * SPEED_OF_SOUND * time / LENGTH
    moved[..., 0] += AMPLITUDE * np.cos(np.pi * points[..., 0] / LENGTH) * np.sin(phase)
    return moved


def make_bar():
    """Small discs across the bar, in four rows along it that take turns.

    Their vertices lie on straight lines along the bar at equal steps: whatever the grid, each of its cells along a line
    holds as much as the next, and the volumes that they share out among their points are those of an even bar.
    """
    import gasp_core as gasp

    step = np.arange(COUNT)
    across = np.column_stack([step // 2 % 2, step % 2]) * (WIDTH - SIZE)
    shade = 0.5 + 0.5 * np.cos(16 * np.pi * step / COUNT)
    return gasp.Gaussians(
        means=np.column_stack([step / (COUNT - 1) * LENGTH, across]),
        # The thin axis is the first: all vertices of a Gaussian are at one place along the bar.
        quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1)),
        scales=np.tile([1e-4 * SIZE, SIZE, SIZE], (COUNT, 1)),
        opacities=np.full(COUNT, 0.95),
        harmonics=np.column_stack([shade, 0.4 + 0.2 * shade, 1.0 - shade])[:, None] - 0.5,
    )


if __name__ == "__main__":
    import gasp_core as gasp

    path = Path(__file__).with_name("bar.ply")
    gasp.write_splat(path, make_bar())
    print(f"wrote {path}; now: gasp run {path.with_name('vibrating_bar.toml')} --trust-code")
