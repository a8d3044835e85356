"""What an angle of internal friction was measured in."""

from __future__ import annotations

import math
from enum import Enum

__all__ = ["FrictionCone"]


class FrictionCone(Enum):
    """How Drucker and Prager's cone q = M (p + c / tan phi) is matched to an angle of internal friction phi.

    q is sqrt(3/2) |dev tau|, p the pressure. Where a cone meets Mohr and Coulomb's pyramid is a choice; what shears at
    constant volume is in the state of simple shear, q = sqrt(3) times the shear stress.

    Attributes
    ----------
    SIMPLE_SHEAR
        M = sqrt(3) tan(phi), of angles from a shear box or of repose: a slope stands at phi.
    PLANE_STRAIN
        M = sqrt(3) sin(phi), of the largest ratio of shear to pressure (s1 - s3) / (s1 + s3) in plane strain at
        constant volume: a slope stands at atan(sin(phi)), 27 degrees for 31.
    TRIAXIAL_COMPRESSION
        M = 6 sin(phi) / (3 - sin(phi)), of the usual test on a cylinder: a slope stands at atan(M / sqrt(3)), 36
        degrees for 31, and what is pressed in plane strain bears as much as if phi were 46.
    """

    SIMPLE_SHEAR = "simple-shear"
    PLANE_STRAIN = "plane-strain"
    TRIAXIAL_COMPRESSION = "triaxial-compression"

    def slope(self, friction_angle: float) -> float:
        """M of an angle [degrees]."""
        angle = math.radians(friction_angle)
        match self:
            case FrictionCone.SIMPLE_SHEAR:
                return math.sqrt(3) * math.tan(angle)
            case FrictionCone.PLANE_STRAIN:
                return math.sqrt(3) * math.sin(angle)
            case FrictionCone.TRIAXIAL_COMPRESSION:
                return 6 * math.sin(angle) / (3 - math.sin(angle))
