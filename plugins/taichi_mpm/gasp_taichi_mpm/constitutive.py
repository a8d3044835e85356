# ruff: noqa: SIM102, SIM109 - "if" of a compile-time constant must stand alone, or what it excludes is compiled; no "in".
"""Materials: what plasticity takes away from a deformation, and the stress that results.

Stress is the Kirchhoff stress times 4 T^2 / (rho dx^2), see `scaling`. A new material is a branch here, a kind in
`layout.KINDS`, a row in `scaling.material_table` and a type in the plugin's capabilities.
"""

import math
from collections.abc import Callable
from typing import Any

from gasp_mpm_host import layout as at

from gasp_core.stepping.flow import FLUID_VOLUME_RATIOS
from gasp_core.stepping.shock import SHOCK_VISCOSITY
from gasp_taichi_mpm.decompositions import cofactors, determinant_with, proper_frames, rotation_of, singular_columns
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["make_response"]

_ROOT = math.sqrt(2 / 3)
"""Equivalent plastic strain per slip of the deviator."""


@ti.func
def _lengths(B):
    return ti.Vector(
        [
            ti.sqrt(B[0, 0] * B[0, 0] + B[1, 0] * B[1, 0] + B[2, 0] * B[2, 0]),
            ti.sqrt(B[0, 1] * B[0, 1] + B[1, 1] * B[1, 1] + B[2, 1] * B[2, 1]),
            ti.sqrt(B[0, 2] * B[0, 2] + B[1, 2] * B[1, 2] + B[2, 2] * B[2, 2]),
        ]
    )


@ti.func
def _volume(F):
    D = ti.cast(F, ti.f64)
    return determinant_with(D, cofactors(D))


def make_response(real: Any, kinds: frozenset[str], *, advance: bool) -> Callable[..., Any]:
    """Taichi function (F, L, history, dt, materials, row) -> (F, history, stress, dilation) for the kinds present.

    With `advance` it applies the material's floors and return mapping to an F that has been moved by dt L; without, it
    gives the stress as things are.
    """
    double = real == ti.f64
    # Newton's iteration and Jacobi's: where half the square of a step, or a cosine, is below rounding.
    polar_tolerance = 1e-15 if double else 1e-7
    cosine = 1e-15 if double else 1e-7
    alone = len(kinds) == 1
    has_elastic, has_neo_hookean, has_sand, has_fluid = (
        kind in kinds for kind in ("elastic", "neo-hookean", "sand", "fluid")
    )
    has_snow, has_foam = "snow" in kinds, "foam" in kinds
    has_ductile = "metal" in kinds or "plasticine" in kinds
    is_elastic, is_neo_hookean, is_sand, is_fluid, is_snow, is_metal, is_plasticine, is_foam = at.KINDS.values()

    @ti.func
    def elastic(F, mu, lame):
        """Fixed-corotated (Stomakhin et al. 2012): 2 mu (F - R) F^T + lambda J (J - 1) I."""
        K = cofactors(F)
        J = determinant_with(F, K)
        R = rotation_of(F, K, J, real(polar_tolerance), real(cosine))
        S = (2 * mu) * ((F - R) @ F.transpose())
        pressure = lame * J * (J - 1)
        for d in ti.static(range(3)):
            S[d, d] += pressure
        return S, J - 1

    @ti.func
    def neo_hookean(F, mu, lame):
        """Compressible neo-Hookean: mu (F F^T - I) + lambda ln(max(J, 0.05)) I."""
        J = determinant_with(F, cofactors(F))
        S = mu * (F @ F.transpose())
        dilation = ti.log(ti.max(J, real(0.05)))
        diagonal = lame * dilation - mu
        for d in ti.static(range(3)):
            S[d, d] += diagonal
        return S, dilation

    @ti.func
    def sand(F, history, mu, lame, cone, loosest):
        """Hencky elasticity and a Drucker-Prager cone with volume correction (Klar et al. 2016; Tampubolon 2017)."""
        B, V = singular_columns(F, real(cosine))
        S = _lengths(B)
        e = ti.log(ti.max(S, real(1e-4)))
        volume = _volume(F)
        # The decomposition's rotations are rotations but for rounding, which changes the volume by as little, at every
        # step in the same direction, and the volume gained adds it all up (2e-5 of the size in 500 float32 steps).
        # In float32 the volume is therefore that of the determinant, and what rounding leaves out is kept on account.
        if ti.static(not double):
            if volume > 1e-3:
                e += (ti.cast(ti.log(volume), real) - e.sum()) / 3
        G = F
        new_history = history
        if ti.static(advance):
            trace = e.sum() + history
            beyond = trace - loosest
            yields = history != 0
            e += history / 3
            if beyond >= 0:
                e = e * 0 + loosest / 3
                new_history = beyond
                yields = True
            else:
                new_history = history * 0
                deviator = e - trace / 3
                size = deviator.norm()
                excess = size + (3 * lame + 2 * mu) / (2 * mu) * beyond * cone
                if excess > 0 and size > 0:
                    e -= (excess / size) * deviator
                    yields = True
            if yields:
                stretch = ti.exp(e) / ti.max(S, real(1e-30))
                D = B
                for c in ti.static(range(3)):
                    for r in ti.static(range(3)):
                        D[r, c] = B[r, c] * stretch[c]
                G = D @ V.transpose()
                if ti.static(not double):
                    if volume > 1e-3:
                        left_out = ti.cast(e.sum(), ti.f64) - ti.log(ti.max(_volume(G), ti.f64(1e-12)))
                        new_history += ti.cast(left_out, real)
        U = B
        W = B
        trace = e.sum()
        for c in ti.static(range(3)):
            for r in ti.static(range(3)):
                U[r, c] = B[r, c] / ti.max(S[c], real(1e-30))
                W[r, c] = U[r, c] * (2 * mu * e[c] + lame * trace)
        return G, new_history, W @ U.transpose()

    @ti.func
    def fluid(L, s, dt, bulk, viscosity):
        """Cole's equation of state without tension, and Newton's viscosity; s = J - 1."""
        spread = L.trace()
        if ti.static(advance):
            s = s + dt * spread * (1 + s)
            s = ti.min(ti.max(s, real(FLUID_VOLUME_RATIOS[0] - 1)), real(FLUID_VOLUME_RATIOS[1] - 1))
        J = 1 + s
        J2 = J * J
        J7 = J2 * J2 * J2 * J
        # J^7 - 1 as a polynomial in s: the difference itself would have no digits left at the small s of a liquid.
        rise = s * (7 + s * (21 + s * (35 + s * (35 + s * (21 + s * (7 + s))))))
        pressure = ti.max(-rise / J7 * bulk / 7, bulk * 0)
        S = (J * viscosity) * (L + L.transpose())
        diagonal = -J * pressure - J * viscosity * (2 * spread / 3)
        for d in ti.static(range(3)):
            S[d, d] += diagonal
        return s, S

    @ti.func
    def upright(F):
        """B = F V with orthogonal columns; V; the rotation U along them; their lengths, none below the floor; det F;
        and whether one was below: of what is inside out, the smallest always is."""
        B, V = singular_columns(F, real(cosine))
        S = _lengths(B)
        volume = _volume(F)
        if volume < 0:
            if S[0] <= S[1] and S[0] <= S[2]:
                S[0] = 0
            elif S[1] <= S[2]:
                S[1] = 0
            else:
                S[2] = 0
        crushed = S.min() <= at.SMALLEST_STRETCH
        return B, V, proper_frames(B), ti.max(S, real(at.SMALLEST_STRETCH)), volume, crushed

    @ti.func
    def restretched(F, B, V, U, S, change, crushed):
        """F with stretches that are 1 + `change` times the S they were.

        By adding what is small: put together anew from rotations, which are rotations but for rounding, F would change
        its volume at every step in the same direction. Only what was crushed has no other way.
        """
        D = B
        for c in ti.static(range(3)):
            for r in ti.static(range(3)):
                D[r, c] = B[r, c] * change[c]
                if crushed:
                    D[r, c] = U[r, c] * S[c] * (1 + change[c])
        G = D @ V.transpose()
        if not crushed:
            G += F
        return G

    @ti.func
    def hencky(F, history, dt, mu, lame, materials: ti.template(), row, viscous: ti.template()):
        """Hencky elasticity with von Mises yield (Simo 1992), or overstress that flows off in time (Yue et al. 2015).

        `gasp_core.contract.materials`: metal, plasticine and foam.
        """
        B, V, U, S, volume, crushed = upright(F)
        e = ti.log(S)
        if ti.static(not double):
            if volume > 1e-3 and not crushed:
                e += (ti.cast(ti.log(volume), real) - e.sum()) / 3
        trace = e.sum()
        deviator = e - trace / 3
        G = F
        new_history = history
        if ti.static(advance):
            size = deviator.norm()
            borne = ti.cast(materials[row + at.YIELD], real)
            slip = size * 0
            if ti.static(viscous):
                relaxation = ti.cast(materials[row + at.RELAXATION], real)
                slip = ti.max(size - borne / (2 * mu), size * 0) * (dt / (dt + relaxation))
            else:
                growth = ti.cast(materials[row + at.HARDENING], real)
                above_line = 2 * mu * size - borne - growth * history
                above_residual = 2 * mu * size - ti.cast(materials[row + at.RESIDUAL], real)
                if above_line > 0 and above_residual > 0:
                    # Radial return to either line, exact for both; what softens faster than it unloads drops at once.
                    slip = above_residual / (2 * mu)
                    slope = 2 * mu + real(_ROOT) * growth
                    if slope > 0:
                        slip = ti.min(slip, above_line / slope)
                    new_history = history + real(_ROOT) * slip
            if slip > 0 or crushed:
                change = deviator * 0
                if slip > 0:
                    change = deviator * (-slip / size)
                e += change
                # In float64, because exp(c) - 1 of a small c has lost its digits.
                G = restretched(F, B, V, U, S, ti.cast(ti.exp(ti.cast(change, ti.f64)) - 1, real), crushed)
        W = U
        for c in ti.static(range(3)):
            for r in ti.static(range(3)):
                W[r, c] = U[r, c] * (2 * mu * e[c] + lame * trace)
        return G, new_history, W @ U.transpose(), trace

    @ti.func
    def snow(F, history, mu, lame, materials: ti.template(), row):
        """Fixed-corotated in a box of stretches; both moduli grow with exp(xi (1 - J_P)) (Stomakhin et al. 2013)."""
        G = F
        new_history = history
        if ti.static(advance):
            least = ti.cast(materials[row + at.LEAST_STRETCH], real)
            greatest = ti.cast(materials[row + at.GREATEST_STRETCH], real)
            B, V, U, S, _, crushed = upright(F)
            kept = ti.min(ti.max(S, least), greatest)
            change = (kept - S) / S
            if change.norm_sqr() > 0 or crushed:
                G = restretched(F, B, V, U, S, change, crushed)
                new_history = history - ti.cast(ti.log(1 + ti.cast(change, ti.f64)).sum(), real)
        # Beyond e^50 times its volume snow is gone, and J_P must not overflow: 0 times infinity is no number.
        ratio = ti.exp(ti.cast(ti.min(new_history, real(50.0)), ti.f64))
        harder = ti.cast(ti.exp(materials[row + at.HARDENING] * (1 - ratio)), real)
        stress, _ = elastic(G, mu * harder, lame * harder)
        return G, new_history, stress

    @ti.func
    def respond(F, L, history, dt, materials: ti.template(), row):
        kind = ti.cast(materials[row + at.KIND], ti.i32)
        mu = ti.cast(materials[row + at.SHEAR], real)
        lame = ti.cast(materials[row + at.LAME], real)
        G = F
        stress = F * 0
        dilation = history * 0
        new_history = history
        if ti.static(has_elastic):
            if ti.static(alone) or kind == is_elastic:
                stress, dilation = elastic(G, mu, lame)
        if ti.static(has_neo_hookean):
            if ti.static(alone) or kind == is_neo_hookean:
                stress, dilation = neo_hookean(G, mu, lame)
        if ti.static(has_elastic or has_neo_hookean):
            if kind <= is_neo_hookean:
                # Kelvin's and Voigt's damping, nought where there is none; and what stops shocks.
                stress += ti.cast(materials[row + at.VISCOSITY], real) * (L + L.transpose())
                spread = L.trace()
                pull = ti.cast(materials[row + at.BULK_VISCOSITY], real) * spread
                if spread < 0 and dt > 0:
                    pull += spread * ti.min(-real(4 * SHOCK_VISCOSITY) * spread, 1 / (3 * dt))
                for d in ti.static(range(3)):
                    stress[d, d] += pull
                rate = ti.cast(materials[row + at.STIFFNESS_DAMPING], real) * spread
                if kind == is_elastic:
                    # d(J - 1)/dt = J tr L, where d(ln J)/dt = tr L.
                    rate *= G.determinant()
                dilation += rate
        if ti.static(has_sand):
            if ti.static(alone) or kind == is_sand:
                G, new_history, stress = sand(
                    G,
                    history,
                    mu,
                    lame,
                    ti.cast(materials[row + at.CONE], real),
                    ti.cast(materials[row + at.LOOSEST_STRAIN], real),
                )
        if ti.static(has_snow):
            if ti.static(alone) or kind == is_snow:
                G, new_history, stress = snow(G, history, mu, lame, materials, row)
        if ti.static(has_ductile):
            if ti.static(alone) or kind == is_metal or kind == is_plasticine:
                G, new_history, stress, dilation = hencky(G, history, dt, mu, lame, materials, row, False)
        if ti.static(has_foam):
            if ti.static(alone) or kind == is_foam:
                G, new_history, stress, dilation = hencky(G, history, dt, mu, lame, materials, row, True)
        if ti.static(has_fluid):
            if ti.static(alone) or kind == is_fluid:
                new_history, stress = fluid(L, history, dt, lame, ti.cast(materials[row + at.VISCOSITY], real))
        return G, new_history, stress, dilation

    return respond
