"""Materials that Genesis lacks, or has otherwise: written as it writes its own, and called where it calls those.

Genesis asks a material for two functions of a particle: what is left of F after a substep's strain, and the Kirchhoff
stress. Whoever derives from one of its materials may give others. Names and order of their parameters are Genesis'.
"""

from __future__ import annotations

import math
from typing import Any

import genesis
import quadrants

__all__ = ["BarotropicFluid", "HardeningMetal", "HardeningSnow"]

_FLUID_RATIOS = (0.1, 10.0)
"""Volume ratios of a fluid are held within these, as our other engines hold them."""
_SMALLEST_STRETCH = 1e-4
_ROOT = math.sqrt(2 / 3)


@quadrants.data_oriented
class BarotropicFluid(genesis.materials.MPM.Base):
    """tau = J (eta (L + L^T - 2/3 tr L I) - p I), p = max(0, K/7 (J^-7 - 1)), L the velocity gradient; K is `E`.

    F is forgotten after each substep, so that the strain of one is F_tmp - I = dt L, and J is what Genesis calls Jp.
    Viscosity comes with the particles, as their actuation: eta / (K dt). So it is compiled for no substep.
    """

    def model_post_init(self, context: Any) -> None:
        """Put the two functions in their places."""
        super().model_post_init(context)
        self.update_F_S_Jp = self._flow
        self.update_stress = self._stress
        # Nothing here asks for rotations or stretches.
        self.needs_svd = False

    @quadrants.func
    def _ratio(self, F_tmp, Jp):
        # Not det F, of which a fluid that only turns would grow.
        grown = Jp * (F_tmp.trace() - 2.0)
        return quadrants.min(quadrants.max(grown, _FLUID_RATIOS[0]), _FLUID_RATIOS[1])

    @quadrants.func
    def _flow(self, J, F_tmp, U, S, V, Jp):
        return quadrants.Matrix.identity(genesis.qd_float, 3), S, self._ratio(F_tmp, Jp)

    @quadrants.func
    def _stress(self, U, S, V, F_tmp, F_new, J, Jp, actu, m_dir):
        ratio = self._ratio(F_tmp, Jp)
        pressure = quadrants.max(0.0, self.E / 7.0 * (quadrants.pow(ratio, -7.0) - 1.0))
        spherical = quadrants.Matrix.identity(genesis.qd_float, 3)
        shear = F_tmp + F_tmp.transpose() - 2.0 / 3.0 * F_tmp.trace() * spherical
        return ratio * (actu * self.E * shear - pressure * spherical)


@quadrants.data_oriented
class HardeningSnow(genesis.materials.MPM.Snow):
    """Genesis' snow, whose stiffness goes with exp(xi (1 - J_P)): any `hardening` xi, and not 10."""

    hardening: float

    def model_post_init(self, context: Any) -> None:
        """Exchange the stress alone."""
        super().model_post_init(context)
        self.update_stress = self._stress

    @quadrants.func
    def _stress(self, U, S, V, F_tmp, F_new, J, Jp, actu, m_dir):
        stiffer = quadrants.exp(self.hardening * (1.0 - Jp))
        shear = 2.0 * self.mu * (F_new - U @ V.transpose()) @ F_new.transpose()
        # J of what is left: Genesis' snow takes what it was before it yielded, and would be pressed beyond its box.
        ratio = F_new.determinant()
        spherical = quadrants.Matrix.identity(genesis.qd_float, 3)
        return stiffer * (shear + self.lam * ratio * (ratio - 1.0) * spherical)


@quadrants.data_oriented
class HardeningMetal(genesis.materials.MPM.Base):
    """Hencky elasticity, sqrt(3/2) |dev tau| <= Y + H p, by radial return; Jp is the equivalent plastic strain p."""

    yield_stress: float
    hardening: float

    def model_post_init(self, context: Any) -> None:
        """Put the two functions in their places."""
        super().model_post_init(context)
        self._default_Jp = 0.0
        self.update_F_S_Jp = self._flow
        self.update_stress = self._stress

    @quadrants.func
    def _strains(self, S):
        strains = quadrants.Vector.zero(genesis.qd_float, 3)
        for i in quadrants.static(range(3)):
            strains[i] = quadrants.log(quadrants.max(S[i, i], _SMALLEST_STRETCH))
        return strains

    @quadrants.func
    def _flow(self, J, F_tmp, U, S, V, Jp):
        strains = self._strains(S)
        deviator = strains - strains.sum() / 3.0
        length = quadrants.sqrt(deviator.dot(deviator))
        slip = (2.0 * self.mu * length - _ROOT * (self.yield_stress + self.hardening * Jp)) / (
            2.0 * self.mu + 2.0 / 3.0 * self.hardening
        )
        F_new = F_tmp
        S_new = S
        Jp_new = Jp
        if slip > 0.0:
            strains -= slip / length * deviator
            Jp_new = Jp + _ROOT * slip
        if slip > 0.0 or S[2, 2] < _SMALLEST_STRETCH:
            S_new = quadrants.Matrix.zero(genesis.qd_float, 3, 3)
            for i in quadrants.static(range(3)):
                S_new[i, i] = quadrants.exp(strains[i])
            F_new = U @ S_new @ V.transpose()
        return F_new, S_new, Jp_new

    @quadrants.func
    def _stress(self, U, S, V, F_tmp, F_new, J, Jp, actu, m_dir):
        strains = self._strains(S)
        principal = quadrants.Matrix.zero(genesis.qd_float, 3, 3)
        for i in quadrants.static(range(3)):
            principal[i, i] = 2.0 * self.mu * strains[i] + self.lam * strains.sum()
        return U @ principal @ U.transpose()
