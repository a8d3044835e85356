"""The solid behind a splat: Gaussians -> the body that they are the surface of.

`solid_of` is a pure function of arrays, `remembered` the same with a cache beside it.
"""

from gasp_core.solid.building import solid_of
from gasp_core.solid.options import SolidOptions
from gasp_core.solid.solid import Doubts, MassProperties, Sheets, Solid

__all__ = ["Doubts", "MassProperties", "Sheets", "Solid", "SolidOptions", "solid_of"]
