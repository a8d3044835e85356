"""What the grid does not see of matter that flows, and what it sees too much of: `gasp_core.stepping.flow` says why."""

# No `from __future__ import annotations`: Warp reads the types themselves.
from functools import cache
from types import SimpleNamespace

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import CROWDED_VOLUME_RATIO, CROWDING_TOLERANCE
from gasp_warp_mpm.contact import open_share
from gasp_warp_mpm.decompositions import algebra
from gasp_warp_mpm.tables import Acting, tables_of
from gasp_warp_mpm.transfers import make_transfers

__all__ = ["make_subgrid"]


@cache
def make_subgrid(double: bool, averaged: bool, has_fluid: bool, *, native: bool) -> SimpleNamespace:
    """The function with_unseen; parameters as `make_kernels`."""
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, mat33 = types.vec3, types.mat33
    Tables = tables_of(real)
    transfers = make_transfers(double, averaged, native=native)
    row3, row9, material_row = transfers.row3, transfers.row9, transfers.material_row
    gather_carried = transfers.gather_carried
    zero, one = real(0.0), real(1.0)
    wide_zero, wide_one, half = wp.float64(0.0), wp.float64(1.0), wp.float64(0.5)
    crowded = wp.float64(1 + CROWDING_TOLERANCE)
    least = real(CROWDED_VOLUME_RATIO - 1)

    @wp.func
    def with_unseen(
        s: Tables, acting: Acting, wall_set: int, p: int, place: wp.vec3d, velocity: vec3, affine: mat33, L: mat33
    ):
        """Velocity and C of the step with what is left of what the grid did not see; the history with room."""
        o = p * at.POINT_WIDTH
        row = material_row(s, p)
        seen, seen_affine, mass = gather_carried(s, p)
        own_affine = row9(s.points, o + at.AFFINE)
        product = own_affine @ L
        fall = real(half * s.step) * (product + wp.transpose(product))
        size = wp.ddot(fall, fall)
        share = zero
        if size > zero:
            share = wp.clamp(wp.ddot(affine - seen_affine, fall) / size, zero, one)
        kept = real(wp.max(wide_one - s.materials[row + at.SUBGRID_DECAY] * s.step, wide_zero))
        v = velocity + kept * (row3(s.points, o + at.VELOCITY) - seen)
        C = affine + kept * (own_affine - seen_affine - share * fall)
        history = s.points[o + at.HISTORY]
        if has_fluid:
            crowding = s.materials[row + at.CROWDING_DECAY] * s.step
            if crowding > wide_zero:
                volume = wp.float64(mass) * s.materials[row + at.FULLNESS] * (wide_one + wp.float64(history))
                excess = volume / open_share(acting, place, wall_set) - crowded
                shrinking = real(crowding * wp.max(excess, wide_zero))
                shrunk = history - (one + history) * shrinking / (one + shrinking)
                history = wp.max(shrunk, wp.min(history, least))
        return v, C, history

    return SimpleNamespace(with_unseen=with_unseen)
