"""The verification cases, judged. Each tolerance stands beside the reason for it."""

from __future__ import annotations

import numpy as np
import pytest

from gasp_conformance import cases, oracles
from gasp_conformance.observables import observed_order
from gasp_conformance.pytest_plugin import Ledger
from gasp_conformance.subject import Subject
from gasp_core.engine.contract import Quantity
from gasp_core.engine.materials import Elastic, Fluid, NeoHookean, Sand

DENSITY = 1000.0


@pytest.mark.parametrize(
    "material",
    [
        Elastic(density=DENSITY, youngs_modulus=1e4, poissons_ratio=0.3),
        NeoHookean(density=DENSITY, youngs_modulus=1e4, poissons_ratio=0.3),
        Sand(density=DENSITY, youngs_modulus=1e4, poissons_ratio=0.3),
        Fluid(density=DENSITY, bulk_modulus=1e4),
    ],
    ids=lambda material: material.kind,
)
def test_v1_free_fall(subject: Subject, ledger: Ledger, material: Elastic | NeoHookean | Sand | Fluid) -> None:
    fall = cases.block_falls(subject, material)
    # Symplectic Euler's own error is g t dt/2 exactly; 5 % for substeps that are not all the largest, and float32's
    # rounding of velocities over a thousand steps stays below 1e-5 of the block's metre.
    ledger.at_most(f"V1 {material.kind}", "largest error [m]", fall.error, 1.05 * fall.euler_error + 1e-5)


def test_v2_drift(subject: Subject, ledger: Ledger) -> None:
    drift = cases.block_drifts(subject)
    # Transfers keep affine fields up to rounding; a second is some hundred substeps of ~10 roundings of a coordinate of
    # a few metres (eps 2.2e-16 and 6e-8), uncorrelated between points.
    ledger.at_most("V2", "shape error / size", drift.shape_error, 1e-12 if subject.is_double else 1e-5)
    ledger.at_most("V2", "momentum error", drift.momentum_error, 1e-12 if subject.is_double else 1e-5)


def test_v3_free_bar_converges(subject: Subject, ledger: Ledger) -> None:
    cells = np.array([8, 16, 32])
    errors = np.array([cases.bar_rings(subject, int(count)) for count in cells])
    for count, error in zip(cells, errors):
        # Quadratic B-splines are second order in space and symplectic Euler, with the step tied to the cell, in time;
        # the constant is one and a half times what was measured with a plane-strain MLS-MPM.
        ledger.at_most(f"V3 {count} cells", "frequency error", error, 1.5 / count**2)
    ledger.at_least("V3", "order over 8, 16, 32 cells", observed_order(1 / cells, errors), 1.8)


def test_v5_column_under_sudden_weight(subject: Subject, ledger: Ledger) -> None:
    cells = 16
    column = cases.column_sinks(subject, cells)
    # Smoothing over a cell is a relative error of O(dx/H) at the foot; half a cell of 16 is 3 %.
    ledger.at_most("V5 16 cells", "peak of the head error", column.peak_error, 0.03)
    ledger.at_most("V5 16 cells", "period error", column.period_error, 0.03)
    ledger.at_most("V5 16 cells", "mean of the head error", column.mean_error, 0.03)
    # Before the head hears of the foot only the smearing of the wave front can show: half a cell of it, of 1 = 2 H c/H.
    ledger.at_most("V5 16 cells", "free fall of the head error", column.fall_error, 0.5 / cells)


@pytest.mark.parametrize("cells", [4, 8, 16])
def test_v8_rigid_spin(subject: Subject, ledger: Ledger, cells: int) -> None:
    kept = cases.block_spins(subject, cells)
    conserves = Quantity.ANGULAR_MOMENTUM in subject.descriptor.capabilities.conserved
    expected = 1.0 if conserves else oracles.spin_kept_by_affine_start_at_rest(1.0, 1.0 / cells)
    # What elastic breathing and the fit of a rigid rotation leave open.
    ledger.at_most(f"V8 {cells} cells", "spin kept - expected", kept - expected, 0.005)
    if conserves and cells >= 8:
        # An engine that starts with the gradient of the initial velocities loses nothing to its affine fields.
        ledger.at_least(f"V8 {cells} cells", "spin kept", kept, 0.9999)


def test_v10_bars_collide(subject: Subject, ledger: Ledger) -> None:
    cells = 32
    bars = cases.bars_collide(subject, cells)
    # Contact goes through shared nodes, where action is reaction: rounding alone, of one bar's momentum.
    ledger.at_most(f"V10 {cells} cells", "total momentum / one bar's", bars.momentum_error, 1e-6)
    # The gap at which bars feel each other is ~1.3 cells, and opens and closes with them: a cell or so in 2 L = 64.
    ledger.at_most(f"V10 {cells} cells", "contact time error", bars.time_error, 0.04)
    # The grid smears the wave front over some cells, and what is smeared comes back too late to push.
    ledger.at_most(f"V10 {cells} cells", "1 - restitution", 1 - bars.restitution, 7.5 / cells)


def test_v12_incline(subject: Subject, ledger: Ledger) -> None:
    slide = cases.block_slides(subject)
    # Coulomb's law is applied node by node to impulses that add up to the weight: what is left are sways of the block.
    ledger.at_most("V12", "way error", slide.distance_error, 0.01)
    ledger.at_most("V12", "creep where it should stick [m/s]", slide.creep, 1e-3)
