"""Small clouds on purpose: compiling dominates, and Warp keeps what it compiled on disk from run to run."""

from types import SimpleNamespace

import numpy as np
import pytest
from gasp_mpm_host import options
from gasp_mpm_host.options import ThreadOptions
from gasp_warp_mpm.engine import WarpMpm

from gasp_core.engine.contract import EngineAccuracy, Field, PointCloud, PointProblem, Precision
from gasp_core.engine.materials import Elastic, Fluid, Foam, Metal, NeoHookean, Plasticine, Sand, Snow

MATERIALS = {
    "elastic": Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
    "neo-hookean": NeoHookean(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),
    "sand": Sand(density=1600.0, youngs_modulus=1e6, poissons_ratio=0.3),
    "fluid": Fluid(density=1000.0, bulk_modulus=1e5, viscosity=1.0),
    "snow": Snow(density=400.0, youngs_modulus=2e5, poissons_ratio=0.3),
    "metal": Metal(density=1000.0, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=2e3, hardening=5e3),
    "plasticine": Plasticine(density=1000.0, youngs_modulus=2e5, poissons_ratio=0.3, yield_stress=4e3),
    "foam": Foam(density=500.0, youngs_modulus=1e5, poissons_ratio=0.3, yield_stress=1e3, plastic_viscosity=200.0),
    # Nearly incompressible, of different weight and stiffness: the mean dilation is one of both where they meet.
    "rubber": Elastic(density=900.0, youngs_modulus=1e5, poissons_ratio=0.49),
    "gel": NeoHookean(density=1200.0, youngs_modulus=5e4, poissons_ratio=0.47),
    "lead": Metal(density=1100.0, youngs_modulus=1e5, poissons_ratio=0.47, yield_stress=2e3),
}


def block(side=0.4, per_axis=8, corner=(0.0, 0.0, 0.0), *, jitter=0.3, seed=3):
    """Points of a cube, one in each of per_axis^3 equal cells, jittered inside them."""
    cells = np.stack(np.meshgrid(*[np.arange(per_axis)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    offset = np.random.default_rng(seed).uniform(-jitter, jitter, cells.shape)
    return (cells + 0.5 + offset) * (side / per_axis) + np.asarray(corner)


def problem(positions, material, *, velocity=(0.0, 0.0, 0.0), side=0.4, ids=None, volumes=None, **scene):
    """A problem of `positions`, together a cube of `side`, in SI units."""
    positions = np.asarray(positions, dtype=float)
    count = len(positions)
    ids = np.zeros(count, dtype=int) if ids is None else ids
    return PointProblem(
        points=PointCloud(
            reference_positions=positions,
            initial_velocities=np.array(np.broadcast_to(np.asarray(velocity, dtype=float), positions.shape)),
            reference_volumes=np.full(count, side**3 / count) if volumes is None else volumes,
            material_ids=ids,
            body_ids=ids,
        ),
        materials=material if isinstance(material, tuple) else (material,),
        **scene,
    )


def open_session(scene, *, precision="float32", threads=1, restart=None, **accuracy):
    accuracy.setdefault("substep_limit", 1_000_000)
    return WarpMpm().open(
        scene,
        device="cpu",
        precision=Precision(precision),
        seed=0,
        accuracy=EngineAccuracy(**accuracy),
        options=ThreadOptions(threads=threads),
        restart=restart,
    )


@pytest.fixture
def kit():
    return SimpleNamespace(
        materials=MATERIALS, block=block, problem=problem, open=open_session, everything=frozenset(Field) - TRACERS
    )


TRACERS = {Field.TRACER_POSITIONS}


@pytest.fixture
def pool_of_four(monkeypatch):
    """Let up to four threads be asked for, whatever the machine has."""
    monkeypatch.setattr(options, "processors", lambda: 4)
