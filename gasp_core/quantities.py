"""Quantities as messages say them: three digits, in the unit in which people would say so many."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["bytes_told", "length_told", "volume_told"]


def bytes_told(count: float) -> str:
    """Of memory or a disk: `count` in MB, GB or TB."""
    return _in_unit(count, ((1e6, "MB"), (1e9, "GB"), (1e12, "TB")))


def length_told(metres: float) -> str:
    """A length [m], in mm, m or km."""
    return _in_unit(metres, ((1e-3, "mm"), (1.0, "m"), (1e3, "km")))


def volume_told(cubic_metres: float) -> str:
    """A volume [m^3], in mm^3, ml, l or m^3; the half of a litre is 0.5 l."""
    return _in_unit(cubic_metres, ((1e-9, "mm^3"), (1e-6, "ml"), (1e-3, "l"), (1.0, "m^3")), least=0.1)


def _in_unit(value: float, units: Sequence[tuple[float, str]], least: float = 1.0) -> str:
    """In the largest of these units, smallest first, of which there is `least` of one, to three digits."""
    fitting = [unit for unit in units if float(f"{value:.3g}") >= least * unit[0]]
    size, name = fitting[-1] if fitting else units[0]
    digits = f"{value / size:.3g}"
    return f"{float(digits):,.0f} {name}" if abs(value) >= 99.95 * size else f"{digits} {name}"
