# ruff: noqa: SIM102 - an "if" of a compile-time constant must stand alone, or what it excludes is compiled.
"""Materials: how F follows the velocity gradient L, what plasticity takes away, and the stress that results.

Stress is the Kirchhoff stress times 4 T^2 / (rho dx^2), see `scaling`. A new material is a branch here, a kind in
`layout.KINDS`, a row in `scaling.material_table` and a type in the plugin's capabilities.
"""

from collections.abc import Callable
from typing import Any

from gasp_taichi_mpm import layout as at
from gasp_taichi_mpm.decompositions import cofactors, determinant_with, rotation_of, singular_columns
from gasp_taichi_mpm.runtime import taichi as ti

__all__ = ["make_response"]


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
    """Taichi function (F, L, gain, dt, materials, row) -> (F, gain, stress, dilation) for the kinds present.

    With `advance` it moves F by dt L and applies the material's floors and return mapping; without, it gives the
    stress as things are.
    """
    double = real == ti.f64
    # Newton's iteration and Jacobi's: where half the square of a step, or a cosine, is below rounding.
    polar_tolerance = 1e-15 if double else 1e-7
    cosine = 1e-15 if double else 1e-7
    alone = len(kinds) == 1
    has_elastic, has_neo_hookean, has_sand, has_fluid = (kind in kinds for kind in at.KINDS)
    is_elastic, is_neo_hookean, is_sand, is_fluid = at.KINDS.values()

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
    def sand(F, gain, mu, lame, cone):
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
        new_gain = gain
        if ti.static(advance):
            trace = e.sum() + gain
            yields = gain != 0
            e += gain / 3
            if trace >= 0:
                e = e * 0
                new_gain = trace
                yields = True
            else:
                new_gain = gain * 0
                deviator = e - trace / 3
                size = deviator.norm()
                excess = size + (3 * lame + 2 * mu) / (2 * mu) * trace * cone
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
                        new_gain += ti.cast(left_out, real)
        U = B
        W = B
        trace = e.sum()
        for c in ti.static(range(3)):
            for r in ti.static(range(3)):
                U[r, c] = B[r, c] / ti.max(S[c], real(1e-30))
                W[r, c] = U[r, c] * (2 * mu * e[c] + lame * trace)
        return G, new_gain, W @ U.transpose()

    @ti.func
    def fluid(L, s, dt, bulk, viscosity):
        """Cole's equation of state without tension, and Newton's viscosity; s = J - 1."""
        spread = L.trace()
        if ti.static(advance):
            s = s + dt * spread * (1 + s)
            s = ti.min(ti.max(s, -real(0.9)), real(9.0))
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
    def respond(F, L, gain, dt, materials: ti.template(), row):
        kind = ti.cast(materials[row + at.KIND], ti.i32)
        mu = ti.cast(materials[row + at.SHEAR], real)
        lame = ti.cast(materials[row + at.LAME], real)
        G = F
        if ti.static(advance):
            G = F + dt * (L @ F)
        stress = F * 0
        dilation = gain * 0
        new_gain = gain
        if ti.static(has_elastic):
            if ti.static(alone) or kind == is_elastic:
                stress, dilation = elastic(G, mu, lame)
        if ti.static(has_neo_hookean):
            if ti.static(alone) or kind == is_neo_hookean:
                stress, dilation = neo_hookean(G, mu, lame)
        if ti.static(has_sand):
            if ti.static(alone) or kind == is_sand:
                G, new_gain, stress = sand(G, gain, mu, lame, ti.cast(materials[row + at.CONE], real))
        if ti.static(has_fluid):
            if ti.static(alone) or kind == is_fluid:
                G = F
                new_gain, stress = fluid(L, gain, dt, lame, ti.cast(materials[row + at.VISCOSITY], real))
        return G, new_gain, stress, dilation

    return respond
