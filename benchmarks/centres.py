"""Means and the engine's deformation gradient against simplices, one engine, one scene: a cylinder that is twisted.

    python benchmarks/centres.py [--sizes 0.04,0.12,0.3] [--resolution 32] [--engine warp-mpm]

Round bars twist as Saint-Venant has it: each slice turns as a whole, by an angle in proportion to its height, so that
where every Gaussian of a cylinder is and what it looks like is known. One end is turned by 120 degrees against the
other, slowly, and damping lets what is between come to rest. POINTS: the engine's. MEAN: distance of those between
the ends from where they should be, over the radius, median. COVARIANCE: |C - J S J^T| / |J S J^T|, J the gradient of
the twist at the mean; median and 95th percentile. PICTURE: PSNR against the known Gaussians, on white. SIZE: largest
scale of the Gaussians, over the radius: what is large is bent as well, which no Gaussian is.

An engine knows F where it has points: with 24,000 Gaussians (--count 24000) their means are as many points as the
simplices of 6,000, and F is that much better.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import gasp_core as gasp
from gasp_core.gaussians import rotation_quaternions
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.renderers import open_renderer

RADIUS, LENGTH, HELD = 0.1, 0.6, 0.1
TURN = np.radians(120)
DURATION, RAMP = 1.6, 0.8
METHODS = {
    "centres": gasp.Reduction(mode="centres"),
    "simplices": gasp.Reduction(mode="all"),
    "filled": gasp.Reduction(mode="volume"),
}


def angle(heights):
    """Of slices at heights [m] once it is twisted [rad]."""
    return TURN * np.clip((heights - HELD) / (LENGTH - 2 * HELD), 0, 1)


def twisted(points, share=1.0):
    turn = share * angle(points[..., 2])
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=-1)


def gradients(points):
    """Of the twist, (N, 3, 3)."""
    turn = angle(points[:, 2])
    inside = (points[:, 2] > HELD) & (points[:, 2] < LENGTH - HELD)
    rate = np.where(inside, TURN / (LENGTH - 2 * HELD), 0.0)
    c, s, zero, one = np.cos(turn), np.sin(turn), np.zeros(len(points)), np.ones(len(points))
    x, y = (twisted(points)[:, k] for k in (0, 1))
    return np.stack([c, -s, -rate * y, s, c, rate * x, zero, zero, one], axis=1).reshape(-1, 3, 3)


def cylinder(count, size, rng):
    """Gaussians in it, coloured in rings so that a picture shows the twist."""
    radii, turns = RADIUS * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    means = np.stack([radii * np.cos(turns), radii * np.sin(turns), rng.uniform(0, LENGTH, count)], axis=1)
    stripes = np.floor(turns / (np.pi / 4)).astype(int) % 2
    colours = np.where(stripes[:, None], [0.8, 0.2, 0.1], [0.1, 0.3, 0.8])
    return gasp.Gaussians(
        means=means,
        quaternions=rng.normal(size=(count, 4)),
        scales=size * RADIUS * np.exp(rng.uniform(-1, 0, (count, 3))),
        opacities=np.full(count, 0.9),
        harmonics=((colours - 0.5) / 0.28209479177387814)[:, None, :],
    )


def scene_of(splat, reduction, resolution):
    low, high = (
        gasp.BoxShape(center=(0, 0, middle), half_extents=(1, 1, HELD / 2)) for middle in (HELD / 2, LENGTH - HELD / 2)
    )
    item = gasp.SplatObject(
        name="bar",
        splat=splat,
        up="+z",
        material=gasp.Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3, mass_damping=20),
        reduction=reduction,
        vertices=4,
    )
    return gasp.Scene(
        objects=(item,),
        duration=DURATION,
        frame_rate=20,
        gravity=(0, 0, 0),
        accuracy=gasp.EngineAccuracy(resolution=resolution),
        maps=gasp.MapChoice(alpha=np.inf),
        drives=(
            gasp.Pinned(region=low),
            gasp.Driven(region=high, angular_velocity=(0, 0, TURN / RAMP), center=(0, 0, LENGTH), end=RAMP),
            gasp.Pinned(region=high, start=RAMP),
        ),
    )


def measured(found, known, truth, camera):
    """Errors of the Gaussians between the held ends, and of a picture."""
    middle = (known.means[:, 2] > HELD) & (known.means[:, 2] < LENGTH - HELD)
    mean = np.median(np.linalg.norm(found.means - truth.means, axis=1)[middle]) / RADIUS
    covariances, expected = found.covariances()[middle], truth.covariances()[middle]
    errors = np.linalg.norm(covariances - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))
    pictures = [
        np.clip(open_renderer().render(RenderInput.of(one), camera).over(np.ones(3)), 0, 1) for one in (found, truth)
    ]
    difference = np.mean((pictures[0] - pictures[1]) ** 2)
    return mean, *np.percentile(errors, [50, 95]), -10 * np.log10(difference), pictures


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", default="0.04,0.12,0.3", help="largest scales, over the radius")
    parser.add_argument("--resolution", type=int, default=32)
    parser.add_argument("--count", type=int, default=6000)
    parser.add_argument("--engine", default="warp-mpm")
    parser.add_argument("--pictures", type=Path, help="a folder for the pictures that are compared")
    asked = parser.parse_args()
    camera = look_at((0.9, -1.2, 0.45), (0, 0, 0.3), width=640, height=640, field_of_view=32)
    heads = (
        ("METHOD", 10),
        ("POINTS", -7),
        ("MEAN", -7),
        ("COVARIANCE", -11),
        ("95 %", -7),
        ("PICTURE", -9),
        ("TIME", -8),
    )
    print(" SIZE  " + " ".join(f"{head:<{width}}" if width > 0 else f"{head:>{-width}}" for head, width in heads))
    for size in map(float, asked.sizes.split(",")):
        splat = cylinder(asked.count, size, np.random.default_rng(0))
        slopes = gradients(splat.means)
        known = pushed(splat, slopes)
        for name, reduction in METHODS.items():
            with tempfile.TemporaryDirectory() as folder:
                begun = time.perf_counter()
                run = gasp.simulate(
                    scene_of(splat, reduction, asked.resolution), asked.engine, Path(folder) / "run.gasp"
                )
                spent = time.perf_counter() - begun
                found, points = run.gaussians(run.frame_count - 1), len(run.start_points)
            mean, median, high, decibels, pictures = measured(found, splat, known, camera)
            print(
                f"{size:5}  {name:10} {points:7,} {mean:7.3f} {median:11.3f} {high:7.3f}"
                f" {decibels:6.1f} dB {spent:6.1f} s",
                flush=True,
            )
            if asked.pictures:
                write(asked.pictures, f"{size}-{name}", pictures[0])
                write(asked.pictures, f"{size}-known", pictures[1])


def pushed(splat, slopes):
    """The Gaussians with F S F^T, at the places that the twist gives them."""
    covariances = slopes @ splat.covariances() @ slopes.transpose(0, 2, 1)
    values, axes = np.linalg.eigh(covariances)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    return splat.with_(
        means=twisted(splat.means),
        quaternions=rotation_quaternions(axes),
        scales=np.sqrt(values),
    )


def write(folder, name, picture):
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray((255 * picture).astype(np.uint8)).save(folder / f"{name}.png")


if __name__ == "__main__":
    main()
