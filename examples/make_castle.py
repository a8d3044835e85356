"""Write the splats of the sand castle: a castle, a bucket and a shovel, flat Gaussians on surfaces made in code.

python examples/make_castle.py
"""

from pathlib import Path

import numpy as np

import gasp_core as gasp
from gasp_core.gaussians import Gaussians, rotation_quaternions

SAND, BUCKET, RIM, BLADE, WOOD = (
    (0.82, 0.68, 0.45),
    (0.16, 0.42, 0.70),
    (0.92, 0.90, 0.84),
    (0.75, 0.18, 0.15),
    (0.62, 0.43, 0.24),
)
SPACING = 0.006
"""Between Gaussians [m]."""


def on_grid(origin, first, second, counts):
    """Places (N, 3) on a flat patch of `counts` cells along two edges, and its normals."""
    u, v = ((np.arange(count) + 0.5) / count for count in counts)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    places = np.asarray(origin) + grid[:, :1] * np.asarray(first) + grid[:, 1:] * np.asarray(second)
    normal = np.cross(first, second)
    return places, np.broadcast_to(normal / np.linalg.norm(normal), places.shape)


def patch(origin, first, second):
    """A flat patch, Gaussians `SPACING` apart."""
    counts = [max(1, round(float(np.linalg.norm(edge)) / SPACING)) for edge in (first, second)]
    return on_grid(origin, np.asarray(first, dtype=float), np.asarray(second, dtype=float), counts)


def box(low, high):
    """The six faces of a box, normals out of it."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    x, y, z = np.diag(high - low)
    faces = [(low, y, x), (low, z, y), (low, x, z), (high, -x, -y), (high, -y, -z), (high, -z, -x)]
    return join([patch(*face) for face in faces])


def ring(below, above, outward=1.0):
    """A band of a cone from (radius, height) `below` to `above`, about z."""
    (r0, z0), (r1, z1) = below, above
    rows = max(1, round(np.hypot(r1 - r0, z1 - z0) / SPACING))
    parts = []
    for share in (np.arange(rows) + 0.5) / rows:
        radius, height = r0 + share * (r1 - r0), z0 + share * (z1 - z0)
        count = max(6, round(2 * np.pi * radius / SPACING))
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (round(share * rows) % 2)) / count
        around = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
        slope = np.array([z1 - z0, r0 - r1])
        slope = outward * slope / np.linalg.norm(slope)
        normals = slope[0] * around + slope[1] * np.array([0.0, 0.0, 1.0])
        parts.append((radius * around + [0, 0, height], normals))
    return join(parts)


def join(parts):
    """Several surfaces as one."""
    return np.concatenate([places for places, _ in parts]), np.concatenate([normals for _, normals in parts])


def splat(surfaces):
    """Gaussians of surfaces, each (places, normals) with a colour."""
    places, normals = join([surface for surface, _ in surfaces])
    colors = np.concatenate([np.broadcast_to(color, surface[0].shape) for surface, color in surfaces])
    generator = np.random.default_rng(0)
    # Grains: colours vary, and so does what one sees of the light.
    colors = np.clip(colors * generator.normal(1.0, 0.06, (len(colors), 1)) * (0.85 + 0.15 * normals[:, 2:]), 0, 1)
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frames = np.stack([first, np.cross(normals, first), normals], axis=2)
    return Gaussians(
        means=places.astype(np.float32),
        quaternions=rotation_quaternions(frames).astype(np.float32),
        scales=np.tile([0.65 * SPACING, 0.65 * SPACING, 0.065 * SPACING], (len(places), 1)).astype(np.float32),
        opacities=np.full(len(places), 0.97, dtype=np.float32),
        harmonics=((colors - 0.5) / 0.28209479177387814)[:, None].astype(np.float32),
    )


def castle():
    """A keep with battlements on a wider base."""
    blocks = [box((-0.15, -0.15, 0.0), (0.15, 0.15, 0.12)), box((-0.1, -0.1, 0.12), (0.1, 0.1, 0.26))]
    for x in (-0.1, -0.02, 0.06):
        for y in (-0.1, -0.02, 0.06):
            if (x, y) != (-0.02, -0.02):
                blocks.append(box((x, y, 0.26), (x + 0.04, y + 0.04, 0.3)))
    return splat([(block, SAND) for block in blocks])


def bucket():
    """Open at the top, with walls that have a thickness."""
    wall, top, foot, height = 0.03, 0.13, 0.1, 0.2
    sides = [
        (ring((foot, 0.0), (top, height)), BUCKET),
        (ring((top, height), (top - wall, height)), RIM),
        (ring((foot - wall, wall), (top - wall, height), -1.0), BUCKET),
        (ring((0.003, 0.0), (foot, 0.0), 1.0), BUCKET),
        (ring((foot - wall, wall), (0.003, wall)), BUCKET),
    ]
    return splat(sides)


def shovel():
    """A blade and a handle, upright, the blade below."""
    blade = box((-0.05, -0.0125, 0.0), (0.05, 0.0125, 0.12))
    return splat([(blade, BLADE), (box((-0.015, -0.0125, 0.12), (0.015, 0.0125, 0.4)), WOOD)])


if __name__ == "__main__":
    for name, make in {"castle": castle, "bucket": bucket, "shovel": shovel}.items():
        path = Path(__file__).with_name(f"{name}.ply")
        gasp.write_splat(path, make())
        print(f"wrote {path}")
    print(f"now: gasp run {Path(__file__).with_name('sand_castle.toml')}")
