# ruff: noqa: SIM102, SIM109 - an "if" of a constant has to stand alone; no "in".
"""Materials: how F follows the velocity gradient L, what plasticity takes away, and the stress that results.

Stress is the Kirchhoff stress times 4 T^2 / (rho dx^2), T the engine's unit of time. A new material is a branch here,
a kind in the layout, a row in the material table and a type in the plugin's capabilities.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
import math
from functools import cache
from typing import Any

import warp as wp
from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import FLUID_VOLUME_RATIOS
from gasp_core.stepping.shock import SHOCK_VISCOSITY
from gasp_warp_mpm.decompositions import algebra, make_decompositions

__all__ = ["make_response"]


@cache
def make_response(double: bool, kinds: frozenset[str], *, advance: bool) -> Any:
    """Warp function (H, L, history, dt, materials, row) -> (H, history, stress, dilation) for the kinds present.

    H is F - I. With `advance` it moves F by dt L and applies the material's floors and return mapping; without, it
    gives the stress as things are.
    """
    real = wp.float64 if double else wp.float32
    types = algebra(real)
    vec3, mat33 = types.vec3, types.mat33
    mat33d = wp.mat33d
    functions, wide = make_decompositions(real), make_decompositions(wp.float64)
    cofactors, determinant_with = functions.cofactors, functions.determinant_with
    singular_columns, rotation_of = functions.singular_columns, functions.rotation_of
    proper_frames = functions.proper_frames
    wide_cofactors, wide_determinant = wide.cofactors, wide.determinant_with
    # Newton's iteration and Jacobi's: where half the square of a step, or a cosine, is below rounding.
    polar_tolerance = real(1e-15 if double else 1e-7)
    cosine = real(1e-15 if double else 1e-7)
    zero, one, two, three, seven = (real(value) for value in (0.0, 1.0, 2.0, 3.0, 7.0))
    twenty_one, thirty_five = real(21.0), real(35.0)
    shock_viscosity = real(4 * SHOCK_VISCOSITY)
    unit = mat33(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    smallest_volume, smallest_stretch, tiny = real(0.05), real(at.SMALLEST_STRETCH), real(1e-30)
    lowest, highest = (real(ratio - 1) for ratio in FLUID_VOLUME_RATIOS)
    countable, least_countable = wp.float64(1e-3), wp.float64(1e-12)
    zero_d, one_d = wp.float64(0.0), wp.float64(1.0)
    # Equivalent plastic strain per slip of the deviator.
    root = real(math.sqrt(2 / 3))
    # Beyond e^50 times its volume snow is gone, and J_P must not overflow: 0 times infinity is no number.
    gone = real(50.0)
    alone = len(kinds) == 1
    has_elastic, has_neo_hookean, has_sand, has_fluid, has_snow, has_metal, has_plasticine, has_foam = (
        name in kinds for name in at.KINDS
    )
    is_elastic, is_neo_hookean, is_sand, is_fluid, is_snow, is_metal, is_plasticine, is_foam = at.KINDS.values()
    has_ductile = has_metal or has_plasticine
    plastic = has_sand or has_snow or has_ductile or has_foam

    @wp.func
    def elastic(F: mat33, mu: real, lame: real):
        """Fixed-corotated (Stomakhin et al. 2012): 2 mu (F - R) F^T + lambda J (J - 1) I."""
        K = cofactors(F)
        J = determinant_with(F, K)
        R = rotation_of(F, K, J, polar_tolerance, cosine)
        S = (two * mu) * ((F - R) @ wp.transpose(F))
        pressure = lame * J * (J - one)
        for d in range(3):
            S[d, d] += pressure
        return S, J - one

    @wp.func
    def neo_hookean(F: mat33, mu: real, lame: real):
        """Compressible neo-Hookean: mu (F F^T - I) + lambda ln(max(J, 0.05)) I."""
        J = determinant_with(F, cofactors(F))
        S = mu * (F @ wp.transpose(F))
        dilation = wp.log(wp.max(J, smallest_volume))
        diagonal = lame * dilation - mu
        for d in range(3):
            S[d, d] += diagonal
        return S, dilation

    @wp.func
    def volume_of(F: mat33):
        """det F in float64."""
        D = mat33d(F)
        return wide_determinant(D, wide_cofactors(D))

    @wp.func
    def lengths_of(B: mat33):
        """Lengths of the columns of B."""
        lengths = vec3()
        for c in range(3):
            lengths[c] = wp.sqrt(B[0, c] * B[0, c] + B[1, c] * B[1, c] + B[2, c] * B[2, c])
        return lengths

    @wp.func
    def sand(F: mat33, gain: real, mu: real, lame: real, cone: real, loosest: real):
        """Hencky elasticity and a Drucker-Prager cone with volume correction (Klar et al. 2016; Tampubolon 2017)."""
        B, V = singular_columns(F, cosine)
        lengths = lengths_of(B)
        e = vec3()
        for c in range(3):
            e[c] = wp.log(wp.max(lengths[c], smallest_stretch))
        volume = volume_of(F)
        # The decomposition's rotations are rotations but for rounding, which changes the volume by as little, at every
        # step in the same direction, and the volume gained adds it all up (2e-5 of the size in 500 float32 steps).
        # In float32 the volume is therefore that of the determinant, and what rounding leaves out is kept on account.
        if not double:
            if volume > countable:
                correction = (real(wp.log(volume)) - (e[0] + e[1] + e[2])) / three
                e = e + vec3(correction)
        G = F * one
        new_gain = gain * one
        if advance:
            trace = e[0] + e[1] + e[2] + gain
            beyond = trace - loosest
            yields = gain != zero
            e = e + vec3(gain / three)
            if beyond >= zero:
                e = vec3(loosest / three)
                new_gain = beyond
                yields = True
            else:
                new_gain = zero
                deviator = e - vec3(trace / three)
                size = wp.length(deviator)
                excess = size + (three * lame + two * mu) / (two * mu) * beyond * cone
                if excess > zero and size > zero:
                    e = e - (excess / size) * deviator
                    yields = True
            if yields:
                D = mat33()
                for c in range(3):
                    stretch = wp.exp(e[c]) / wp.max(lengths[c], tiny)
                    for r in range(3):
                        D[r, c] = B[r, c] * stretch
                G = D @ wp.transpose(V)
                if not double:
                    if volume > countable:
                        kept = wp.log(wp.max(volume_of(G), least_countable))
                        new_gain = new_gain + real(wp.float64(e[0] + e[1] + e[2]) - kept)
        U = mat33()
        W = mat33()
        total = e[0] + e[1] + e[2]
        for c in range(3):
            for r in range(3):
                U[r, c] = B[r, c] / wp.max(lengths[c], tiny)
                W[r, c] = U[r, c] * (two * mu * e[c] + lame * total)
        return G, new_gain, W @ wp.transpose(U)

    @wp.func
    def fluid(L: mat33, before: real, dt: real, bulk: real, viscosity: real):
        """Cole's equation of state without tension, and Newton's viscosity; s = J - 1."""
        spread = wp.trace(L)
        s = before * one
        if advance:
            s = s + dt * spread * (one + s)
            s = wp.min(wp.max(s, lowest), highest)
        J = one + s
        J2 = J * J
        J7 = J2 * J2 * J2 * J
        # J^7 - 1 as a polynomial in s: the difference itself would have no digits left at the small s of a liquid.
        rise = s * (
            seven + s * (twenty_one + s * (thirty_five + s * (thirty_five + s * (twenty_one + s * (seven + s)))))
        )
        pressure = wp.max(-rise / J7 * bulk / seven, zero)
        S = (J * viscosity) * (L + wp.transpose(L))
        diagonal = -J * pressure - J * viscosity * (two * spread / three)
        for d in range(3):
            S[d, d] += diagonal
        return s, S

    @wp.func
    def upright(F: mat33):
        """B = F V with orthogonal columns; V; the rotation U along them; their lengths, none below the floor; det F;
        and whether one was below: of what is inside out, the smallest always is."""
        B, V = singular_columns(F, cosine)
        S = lengths_of(B)
        volume = volume_of(F)
        if volume < zero_d:
            if S[0] <= S[1] and S[0] <= S[2]:
                S[0] = zero
            elif S[1] <= S[2]:
                S[1] = zero
            else:
                S[2] = zero
        crushed = wp.min(S) <= smallest_stretch
        return B, V, proper_frames(B), wp.max(S, vec3(smallest_stretch)), volume, crushed

    @wp.func
    def restretched(F: mat33, B: mat33, V: mat33, U: mat33, S: vec3, change: vec3, crushed: bool):
        """F with stretches that are 1 + `change` times the S they were.

        By adding what is small: put together anew from rotations, which are rotations but for rounding, F would change
        its volume at every step in the same direction. Only what was crushed has no other way.
        """
        D = mat33()
        G = F * one
        if crushed:
            for c in range(3):
                for r in range(3):
                    D[r, c] = U[r, c] * S[c] * (one + change[c])
            G = D @ wp.transpose(V)
        else:
            for c in range(3):
                for r in range(3):
                    D[r, c] = B[r, c] * change[c]
            G = F + D @ wp.transpose(V)
        return G

    @wp.func
    def hencky(
        F: mat33,
        history: real,
        dt: real,
        mu: real,
        lame: real,
        materials: wp.array(dtype=wp.float64),
        row: int,
        kind: int,
    ):
        """Hencky elasticity with von Mises yield (Simo 1992), or overstress that flows off in time (Yue et al. 2015).

        `gasp_core.contract.materials`: metal, plasticine and foam.
        """
        B, V, U, S, volume, crushed = upright(F)
        e = vec3()
        for c in range(3):
            e[c] = wp.log(S[c])
        if not double:
            if volume > countable and not crushed:
                e = e + vec3((real(wp.log(volume)) - (e[0] + e[1] + e[2])) / three)
        trace = e[0] + e[1] + e[2]
        deviator = e - vec3(trace / three)
        G = F * one
        new_history = history * one
        if advance:
            size = wp.length(deviator)
            borne = real(materials[row + at.YIELD])
            slip = real(0.0)
            if has_foam:
                if alone or kind == is_foam:
                    relaxation = real(materials[row + at.RELAXATION])
                    slip = wp.max(size - borne / (two * mu), zero) * (dt / (dt + relaxation))
            if has_ductile:
                if not has_foam or kind != is_foam:
                    growth = real(materials[row + at.HARDENING])
                    above_line = two * mu * size - borne - growth * history
                    above_residual = two * mu * size - real(materials[row + at.RESIDUAL])
                    if above_line > zero and above_residual > zero:
                        # Radial return to either line, exact for both; what softens faster than it unloads drops at
                        # once.
                        slip = above_residual / (two * mu)
                        slope = two * mu + root * growth
                        if slope > zero:
                            slip = wp.min(slip, above_line / slope)
                        new_history = history + root * slip
            if slip > zero or crushed:
                change = vec3()
                if slip > zero:
                    change = (-slip / size) * deviator
                e = e + change
                # In float64, because exp(c) - 1 of a small c has lost its digits.
                stretch = vec3()
                for c in range(3):
                    stretch[c] = real(wp.exp(wp.float64(change[c])) - one_d)
                G = restretched(F, B, V, U, S, stretch, crushed)
        W = mat33()
        for c in range(3):
            for r in range(3):
                W[r, c] = U[r, c] * (two * mu * e[c] + lame * trace)
        return G, new_history, W @ wp.transpose(U), trace

    @wp.func
    def snow(F: mat33, history: real, mu: real, lame: real, materials: wp.array(dtype=wp.float64), row: int):
        """Fixed-corotated in a box of stretches; both moduli grow with exp(xi (1 - J_P)) (Stomakhin et al. 2013)."""
        G = F * one
        new_history = history * one
        if advance:
            least = vec3(real(materials[row + at.LEAST_STRETCH]))
            greatest = vec3(real(materials[row + at.GREATEST_STRETCH]))
            B, V, U, S, _volume, crushed = upright(F)
            change = wp.cw_div(wp.min(wp.max(S, least), greatest) - S, S)
            if wp.length_sq(change) > zero or crushed:
                G = restretched(F, B, V, U, S, change, crushed)
                lost = wp.float64(0.0)
                for c in range(3):
                    lost += wp.log(one_d + wp.float64(change[c]))
                new_history = history - real(lost)
        ratio = wp.exp(wp.float64(wp.min(new_history, gone)))
        harder = real(wp.exp(materials[row + at.HARDENING] * (one_d - ratio)))
        stress, _dilation = elastic(G, mu * harder, lame * harder)
        return G, new_history, stress

    @wp.func
    def respond(before: mat33, L: mat33, history: real, dt: real, materials: wp.array(dtype=wp.float64), row: int):
        kind = int(materials[row + at.KIND])
        mu = real(materials[row + at.SHEAR])
        lame = real(materials[row + at.LAME])
        H = before * one
        if advance:
            H = before + dt * (L + L @ before)
        F = H + unit
        G = F * one
        stress = mat33()
        dilation = real(0.0)
        new_history = history * one
        if has_elastic:
            if alone or kind == is_elastic:
                stress, dilation = elastic(F, mu, lame)
        if has_neo_hookean:
            if alone or kind == is_neo_hookean:
                stress, dilation = neo_hookean(F, mu, lame)
        if has_elastic or has_neo_hookean:
            if kind <= is_neo_hookean:
                # Kelvin's and Voigt's damping, nought where there is none; and what stops shocks.
                stress = stress + real(materials[row + at.VISCOSITY]) * (L + wp.transpose(L))
                spread = wp.trace(L)
                pull = real(materials[row + at.BULK_VISCOSITY]) * spread
                if spread < zero and dt > zero:
                    pull += spread * wp.min(-shock_viscosity * spread, one / (three * dt))
                for d in range(3):
                    stress[d, d] += pull
                rate = real(materials[row + at.STIFFNESS_DAMPING]) * spread
                if kind == is_elastic:
                    # d(J - 1)/dt = J tr L, where d(ln J)/dt = tr L.
                    rate *= wp.determinant(F)
                dilation += rate
        if has_sand:
            if alone or kind == is_sand:
                G, new_history, stress = sand(
                    F, history, mu, lame, real(materials[row + at.CONE]), real(materials[row + at.LOOSEST_STRAIN])
                )
        if has_snow:
            if alone or kind == is_snow:
                G, new_history, stress = snow(F, history, mu, lame, materials, row)
        if has_ductile or has_foam:
            if alone or kind == is_metal or kind == is_plasticine or kind == is_foam:
                G, new_history, stress, dilation = hencky(F, history, dt, mu, lame, materials, row, kind)
        if has_fluid:
            if alone or kind == is_fluid:
                H = before * one
                new_history, stress = fluid(L, history, dt, lame, real(materials[row + at.VISCOSITY]))
        if plastic:
            # Nothing but what flowed: H keeps the digits that F has not.
            H = H + (G - F)
        return H, new_history, stress, dilation

    return respond
