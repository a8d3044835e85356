"""Engine-neutral materials, in SI units.

A class is the whole declaration: engines name the classes they model (`EngineCapabilities.materials`), scene files
name them by `kind`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from gasp_core.contract.friction_cone import FrictionCone
from gasp_core.contract.validation import finite, positive
from gasp_core.errors import SceneError

__all__ = [
    "MATERIALS",
    "Elastic",
    "Fluid",
    "Foam",
    "Material",
    "Metal",
    "NeoHookean",
    "Plasticine",
    "Rigid",
    "Sand",
    "Snow",
]


_LONGEST_NAME = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Anything that has mass.

    Parameters
    ----------
    density
        Mass per volume at rest [kg/m^3].
    name
        What people call it, for messages: "steel". It decides nothing, and materials that differ in nothing else are
        equal.
    """

    kind: ClassVar[str] = ""
    density: float
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        positive(self, "density")
        # Whatever type checkers think, a Python caller may hand over anything.
        called: Any = self.name
        if not isinstance(called, str) or len(called) > _LONGEST_NAME or not called.isprintable():
            raise SceneError(
                f"{type(self).__name__}.name must be up to {_LONGEST_NAME} printable characters, found"
                f" {str(called)[:40]!r}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Solid(Material):
    """A material with a stiffness at small strain.

    Parameters
    ----------
    youngs_modulus
        E [Pa], > 0.
    poissons_ratio
        nu, > -1 and < 0.5.
    """

    youngs_modulus: float
    poissons_ratio: float

    def __post_init__(self) -> None:
        Material.__post_init__(self)
        positive(self, "youngs_modulus")
        finite(self, "poissons_ratio", low=-1.0)
        # lambda = E nu / ((1 + nu)(1 - 2 nu)) is infinite at 1/2 and mu at -1.
        if not -1.0 < self.poissons_ratio < 0.5:
            raise SceneError(
                f"{type(self).__name__}.poissons_ratio must be > -1 and < 0.5, found {self.poissons_ratio!r}"
                " (0.5 is an incompressible solid; use 0.49, or a fluid)"
            )

    @property
    def shear_modulus(self) -> float:
        """Lame's mu [Pa]."""
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))

    @property
    def lame_lambda(self) -> float:
        """Lame's first parameter lambda [Pa]."""
        nu = self.poissons_ratio
        return self.youngs_modulus * nu / ((1 + nu) * (1 - 2 * nu))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Springy(_Solid):
    """Elastic alone, with Rayleigh's damping.

    A motion of angular frequency omega [rad/s] dies away as exp(-z omega t), z = (a / omega + b omega) / 2 (Rayleigh
    1877, section 102; Bathe 2014, "Finite element procedures", 9.3.3).

    Parameters
    ----------
    mass_damping
        a [1/s], >= 0: a force -a v per mass. It stills what is slow first, a fall as well as a swing: what falls for
        long goes at g / a. It costs nothing.
    stiffness_damping
        b [s], >= 0, after Kelvin and Voigt: tau grows by b (2 mu D + lambda tr D I), D being the rate of strain. It
        stills what is fast first, and nothing that moves as one. An explicit engine's step is shorter for it: of
        matter that bears h without, h^2 / (b + sqrt(h^2 + b^2)).
    """

    mass_damping: float = 0.0
    stiffness_damping: float = 0.0

    def __post_init__(self) -> None:
        _Solid.__post_init__(self)
        finite(self, "mass_damping", low=0.0)
        finite(self, "stiffness_damping", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Elastic(_Springy):
    """Elastic solid, fixed-corotated: tau = 2 mu (F - R) F^T + lambda (J - 1) J I (Stomakhin et al. 2012)."""

    kind: ClassVar[str] = "elastic"


@dataclass(frozen=True, slots=True, kw_only=True)
class NeoHookean(_Springy):
    """Elastic solid, compressible neo-Hookean: tau = mu (F F^T - I) + lambda ln(J) I (Bonet and Wood 2008, 6.29)."""

    kind: ClassVar[str] = "neo-hookean"


_STEEPEST = 60.0
"""Degrees, where sqrt(3) tan(phi) is 3 and a cylinder bears whatever presses it."""
_MOST_COHESION = 0.1
"""Of the bulk modulus: the tension that cohesion bears."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sand(_Solid):
    """Granular matter: Hencky elasticity with a Drucker-Prager cone (Klar et al. 2016, 10.1145/2897824.2925906).

    It flows at constant volume. Volume gained while it was loose is given back before it presses again (Tampubolon et
    al. 2017, 10.1145/3072959.3073651).

    Parameters
    ----------
    friction_angle
        phi, internal friction angle [degrees], > 0 and < 90; with a cone matched to simple shear < 60.
    cone
        What the angle was measured in, `FrictionCone`.
    cohesion
        c [Pa], >= 0, of moist sand: shear that is borne without pressure. Bridges that broke are there again where
        grains touch again. For engines that declare `cohesion`.
    """

    kind: ClassVar[str] = "sand"
    friction_angle: float = 35.0
    cone: FrictionCone = FrictionCone.SIMPLE_SHEAR
    cohesion: float = 0.0

    def __post_init__(self) -> None:
        _Solid.__post_init__(self)
        finite(self, "friction_angle", low=0.0, open_low=True)
        if self.friction_angle >= 90:
            raise SceneError(f"Sand.friction_angle must be < 90 degrees, found {self.friction_angle!r}")
        # Whatever type checkers think, a Python caller may hand over anything.
        cone: Any = self.cone
        if not isinstance(cone, FrictionCone):
            raise SceneError(f"Sand.cone must be a FrictionCone, found {str(cone)[:40]!r}")
        if cone is FrictionCone.SIMPLE_SHEAR and self.friction_angle >= _STEEPEST:
            raise SceneError(
                f"Sand.friction_angle must be < {_STEEPEST:g} degrees in simple shear, found {self.friction_angle!r}:"
                ' one from a triaxial test needs cone = "triaxial-compression"'
            )
        finite(self, "cohesion", low=0.0)
        if self.loosest_strain > _MOST_COHESION:
            raise SceneError(
                f"Sand.cohesion / tan(friction_angle) must be <= {_MOST_COHESION:g} of the bulk modulus, found"
                f" {self.loosest_strain:.3g} of it, {self.tension_limit:.3g} Pa: lower the cohesion, raise"
                " youngs_modulus, or take metal or plasticine, which yield at a stress of their own"
            )

    @property
    def friction_slope(self) -> float:
        """M, of the cone q = M (p + c / tan(friction_angle))."""
        return self.cone.slope(self.friction_angle)

    @property
    def tension_limit(self) -> float:
        """c / tan(friction_angle) [Pa], the tension from all sides that cohesion bears: the tip of the cone."""
        return self.cohesion / math.tan(math.radians(self.friction_angle))

    @property
    def loosest_strain(self) -> float:
        """ln J at the tip of the cone."""
        return self.tension_limit / (self.lame_lambda + 2 / 3 * self.shear_modulus)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fluid(Material):
    """Weakly compressible fluid that bears no tension.

    p = max(0, K/7 (J^-7 - 1)) (Cole 1948; Becker and Teschner 2007), shear stress 2 eta dev(sym grad v).

    Parameters
    ----------
    bulk_modulus
        K [Pa], the stiffness at rest density. Water has 2.2e9; 1e5 looks the same and costs a hundredth.
    viscosity
        Dynamic viscosity eta [Pa s], >= 0.
    """

    kind: ClassVar[str] = "fluid"
    bulk_modulus: float
    viscosity: float = 0.0

    def __post_init__(self) -> None:
        Material.__post_init__(self)
        positive(self, "bulk_modulus")
        finite(self, "viscosity", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Snow(_Solid):
    """Snow: fixed-corotated, with a box of allowed stretches, and the stiffer the more it was pressed.

    Stomakhin et al. 2013, "A material point method for snow simulation" (10.1145/2461912.2461948), section 5. The
    singular values of F_E are held within [1 - theta_c, 1 + theta_s]; what is beyond goes into F_P, and both of Lame's
    parameters are exp(xi (1 - J_P)) times those at rest, J_P = det F_P: without a cap, and below 1 where it was pulled.

    Parameters
    ----------
    critical_compression
        theta_c, >= 0 and <= 1.
    critical_stretch
        theta_s, >= 0.
    hardening
        xi, >= 0. A step has to be shorter by exp(xi (1 - J_P) / 2).
    """

    kind: ClassVar[str] = "snow"
    critical_compression: float = 0.025
    critical_stretch: float = 0.0075
    hardening: float = 10.0

    def __post_init__(self) -> None:
        _Solid.__post_init__(self)
        finite(self, "critical_compression", low=0.0, high=1.0)
        finite(self, "critical_stretch", low=0.0)
        finite(self, "hardening", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Yielding(_Solid):
    """Hencky elasticity that flows at constant volume where it is sheared too hard.

    tau = 2 mu e + lambda tr(e) I of the logarithmic elastic strain e. It flows along the deviator s of tau where
    sqrt(3/2) |s| is above the yield stress (von Mises 1913), which is the tension at which a bar yields; p is the
    equivalent plastic strain, dp = sqrt(2/3) |d e_P|, which is the stretch for good of such a bar.

    Parameters
    ----------
    yield_stress
        Y [Pa], of what has not flowed yet.
    """

    yield_stress: float

    def __post_init__(self) -> None:
        _Solid.__post_init__(self)
        positive(self, "yield_stress")


@dataclass(frozen=True, slots=True, kw_only=True)
class Metal(_Yielding):
    """Hencky elasticity with von Mises yield and linear isotropic hardening.

    sqrt(3/2) |dev tau| <= Y + H p, p being the equivalent plastic strain (Simo 1992, 10.1016/0045-7825(92)90123-2): a
    bar that is pulled beyond Y stiffens by E H / (E + H).

    Parameters
    ----------
    yield_stress
        Y [Pa].
    hardening
        H [Pa], >= 0.
    """

    kind: ClassVar[str] = "metal"
    hardening: float = 0.0

    def __post_init__(self) -> None:
        _Yielding.__post_init__(self)
        finite(self, "hardening", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plasticine(_Yielding):
    """Hencky elasticity with von Mises yield that softens as it flows.

    sqrt(3/2) |dev tau| <= Y max(1 - c p, r), p being the equivalent plastic strain: `Metal`'s law with H = -c Y, down
    to what is left.

    Parameters
    ----------
    yield_stress
        Y [Pa].
    softening
        c, >= 0: the share of Y that is lost per unit of plastic strain.
    residual
        r, > 0 and <= 1: the share of Y that is never lost.
    """

    kind: ClassVar[str] = "plasticine"
    softening: float = 1.0
    residual: float = 0.5

    def __post_init__(self) -> None:
        _Yielding.__post_init__(self)
        finite(self, "softening", low=0.0)
        finite(self, "residual", low=0.0, open_low=True, high=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Foam(_Yielding):
    """Viscoplastic Hencky solid: what is above its yield stress flows off at a finite rate.

    |d e_P / dt| = max(0, |dev tau| - sqrt(2/3) Y) / eta (Yue et al. 2015, 10.1145/2751541, section 3, with h = 1). In
    steady simple shear at a rate g the shear stress is Y / sqrt(3) + eta g / 2: eta is twice Bingham's plastic
    viscosity.

    Parameters
    ----------
    yield_stress
        Y [Pa].
    plastic_viscosity
        eta [Pa s], >= 0. Without it, foam is metal that does not harden.
    """

    kind: ClassVar[str] = "foam"
    plastic_viscosity: float = 0.0

    def __post_init__(self) -> None:
        _Yielding.__post_init__(self)
        finite(self, "plastic_viscosity", low=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rigid(Material):
    """A body that does not deform.

    Parameters
    ----------
    restitution
        Newton's coefficient, >= 0 and <= 1, of speeds along the normal after a collision and before it: with a wall
        this number, between two rigid bodies the product of theirs, and with other matter none, which bounces by its
        own elasticity. For engines that declare `restitution`; 0: nothing bounces back because of it.
    """

    kind: ClassVar[str] = "rigid"
    restitution: float = 0.0

    def __post_init__(self) -> None:
        Material.__post_init__(self)
        finite(self, "restitution", low=0.0, high=1.0)


MATERIALS: dict[str, type[Material]] = {
    material.kind: material for material in (Elastic, NeoHookean, Sand, Fluid, Snow, Metal, Plasticine, Foam, Rigid)
}
