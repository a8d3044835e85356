"""Native code against the readable functions beside it, and against closed forms."""

from functools import partial

import numpy as np
import pytest
from gasp_mpm_host import layout as at
from gasp_mpm_host.forcing_tables import Forcing
from gasp_mpm_host.session import MpmSession
from gasp_warp_mpm import runtime
from gasp_warp_mpm.cloud import Cloud

from gasp_core.contract import Collider, EngineAccuracy, HalfSpace, Status

SIDE = 0.4
STEP = 2e-4
STEPS = 200
# The sums have some 30 terms, and in native code momentum is relative to a point of the tile. float64: 30 roundings of
# 1.1e-16 of 2 m/s, in the same direction in all of 200 steps, are 1.3e-12 m/s and, in 0.04 s, 5e-14 m = 1.3e-13 of the
# side; stress has the speed of sound for its unit, 8 times more. float32: 200 half ulps of 2 m/s in the same direction
# are 2.4e-6 of the side; the bar against the reference engine.
TOLERANCE = {"float64": 1e-12, "float32": 1e-5}


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize(
    "kinds",
    [("elastic",), ("neo-hookean",), ("rubber",), ("neo-hookean", "elastic"), ("sand", "elastic", "fluid")],
    ids="+".join,
)
def test_native_and_readable_bodies_agree(kit, kinds, precision):
    blocks = [kit.block(SIDE, corner=(0, 0, 0.05 + 0.42 * index), seed=index) for index in range(len(kinds))]
    positions = np.concatenate(blocks)
    problem = kit.problem(
        positions,
        tuple(kit.materials[kind] for kind in kinds),
        ids=np.repeat(np.arange(len(kinds)), len(blocks[0])),
        volumes=np.full(len(positions), SIDE**3 / len(blocks[0])),
        velocity=np.array([0.5, 0.0, -2.0]) + np.random.default_rng(1).normal(scale=0.1, size=positions.shape),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),),
    )
    found = []
    for native in (False, True):
        build = partial(
            Cloud,
            device=runtime.device_for("cpu"),
            double=precision == "float64",
            threads=1,
            atomic=False,
            native=native,
        )
        accuracy = EngineAccuracy(spacing=0.1, substep=STEP)
        with MpmSession(problem, engine="warp-mpm", accuracy=accuracy, build=build) as session:
            assert session.advance_to(STEP * STEPS).status is Status.OK
            found.append(session.read(kit.everything))
    assert np.abs(found[0].positions - found[1].positions).max() / SIDE <= TOLERANCE[precision]
    assert np.abs(found[1].positions - positions).max() > 0.05 * SIDE  # something happened
    if precision == "float64":
        assert np.abs(found[0].velocities - found[1].velocities).max() <= 1e-10


def turned(rng, count):
    """(count, 3, 3) orthogonal matrices of either sign."""
    return np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]


def deformations():
    """Near identity, stretched 1/100 .. 100, mirrored, flat, and the same everywhere from 1/10 to 100; (N, 3, 3)."""
    rng = np.random.default_rng(0)
    near = np.eye(3) + 0.05 * rng.normal(size=(200, 3, 3))
    stretched = turned(rng, 200) @ (10 ** rng.uniform(-2, 2, (200, 3, 1)) * turned(rng, 200))
    mirrored = near[:50] @ np.diag([1.0, 1.0, -1.0])
    flat = near[50:100].copy()
    flat[:, :, 1] = flat[:, :, 0]
    swollen = np.concatenate([10 ** rng.uniform(-1, 2, 100), 1 + rng.uniform(-1e-6, 1e-6, 100), [1.0]])
    whole = np.concatenate([near, stretched, mirrored, flat, swollen[:, None, None] * np.eye(3)])
    # Every group of points has some of each, and the last is not full.
    return whole[rng.permutation(len(whole))][:797]


def kirchhoff(kind, F, mu, lame):
    """Stress (N, 3, 3) in float64 from singular values, its dilation, and by what factor rounding in F grows in both.

    The rotation nearest to F changes by s1/(s2 + s3) of a relative change of F, s3 with the sign of det F, and where it
    is found by way of the inverse by s1/s3. The dilation is det F or its logarithm, where |F|^3 rounds and det F is
    what is left.
    """
    U, s, V = np.linalg.svd(F)
    J = np.linalg.det(U @ V) * s.prod(axis=1)
    size = np.linalg.norm(F, axis=(1, 2))
    identity = np.eye(3)
    if kind == "elastic":
        sign = np.where(J < 0, -1.0, 1.0)
        U[:, :, 2] *= sign[:, None]
        s[:, 2] *= sign
        R = U @ V
        stress = 2 * mu * (F - R) @ F.transpose(0, 2, 1) + (lame * J * (J - 1))[:, None, None] * identity
        by_inverse = (J > 0) & ((size**2 / 3) ** 3 * 1e-6 < J**2)
        growth = s[:, 0] / np.maximum(s[:, 1] + s[:, 2], 1e-300)
        growth = np.where(by_inverse, np.maximum(growth, s[:, 0] / s[:, 2]), growth)
        rounding = 2 * mu * size * (size + growth) + lame * (np.abs(J) + np.abs(J - 1)) * (size**3 + 1)
        return stress, J - 1, rounding, size**3 + 1, by_inverse
    volume = np.maximum(J, 0.05)
    stress = mu * (F @ F.transpose(0, 2, 1)) + (lame * np.log(volume) - mu)[:, None, None] * identity
    spread = size**3 / volume + np.abs(np.log(volume)) + 1
    return stress, np.log(volume), mu * (size**2 + 1) + lame * spread, spread, np.ones(len(F), dtype=bool)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("kind", ["elastic", "neo-hookean"])
def test_the_stress_of_any_deformation(kit, kind, precision):
    """In one step of no length nothing moves, and the stress is that of the deformations that were put in."""
    given = deformations()
    problem = kit.problem(np.random.default_rng(2).uniform(0, 0.4, (len(given), 3)), kit.materials[kind])
    with kit.open(problem, precision=precision, spacing=0.1) as session:
        cloud = session._held
        points = cloud._rows().points
        points[:, at.DISPLACEMENT_GRADIENT : at.DISPLACEMENT_GRADIENT + 9] = (given - np.eye(3)).reshape(-1, 9)
        cloud.begin_batch(0.0, np.zeros(3), Forcing.none(1))
        assert cloud.steps(0, 1) == (1, False, False)
        material = cloud._tables.materials.numpy()
        H = points[:, at.DISPLACEMENT_GRADIENT : at.DISPLACEMENT_GRADIENT + 9].reshape(-1, 3, 3)
        F = (H + np.eye(3, dtype=H.dtype)).astype(np.float64)
        found = points[:, at.STRESS : at.STRESS + 6].astype(np.float64)
        dilation = points[:, at.DILATION].astype(np.float64)
    assert np.array_equal(H, (given - np.eye(3)).astype(precision))
    stress, expected, rounding, spread, together = kirchhoff(kind, F, material[at.SHEAR], material[at.LAME])
    assert (together.sum(), (~together).sum()) == (len(F), 0) if kind == "neo-hookean" else (~together).sum() > 100
    entries = stress[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    # Some twenty operations each way.
    eps = np.finfo(precision).eps
    assert (np.abs(found - entries).max(axis=1) <= 40 * eps * rounding).all()
    assert (np.abs(dilation - expected) <= 20 * eps * spread).all()
    if kind == "neo-hookean":
        # Of what swells evenly det F has two roundings, so that what is left is the logarithm's own.
        even = (F[:, :1, :1] * np.eye(3) == F).all(axis=(1, 2))
        assert even.sum() > 100
        own = np.maximum(F[even, 0, 0] ** 3, 0.05)
        assert (np.abs(dilation[even] - np.log(own)) <= 2 * eps * (1 + np.abs(np.log(own)))).all()


@pytest.mark.parametrize("kinds", [("elastic",), ("neo-hookean", "elastic")], ids="+".join)
def test_groups_that_are_not_full_change_with_neither_threads_nor_a_restart(kit, monkeypatch, kinds):
    monkeypatch.setattr("gasp_core.stepping.threads.processors", lambda: 4)
    positions = kit.block(SIDE, 9, corner=(0, 0, 0.03))
    assert len(positions) % 8 != 0
    problem = kit.problem(
        positions,
        tuple(kit.materials[kind] for kind in kinds),
        ids=np.random.default_rng(0).integers(0, len(kinds), len(positions)),
        velocity=(0.3, 0, -2),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)), friction=0.4),),
    )
    found = []
    for threads in (1, 2, 4):
        with kit.open(problem, spacing=0.05, threads=threads) as session:
            session.advance_to(0.02)
            kept = session.checkpoint()
            session.advance_to(0.04)
            found.append(session.read(kit.everything))
    with kit.open(problem, spacing=0.05, restart=kept) as session:
        session.advance_to(0.04)
        found.append(session.read(kit.everything))
    for name in ("positions", "velocities", "deformation_gradients"):
        first = getattr(found[0], name)
        assert all(np.array_equal(getattr(other, name), first) for other in found[1:])
