"""The constants of native code: what stands for each word of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from gasp_mpm_host import layout as at

from gasp_core.stepping.mpm import GRADIENT_SHARE
from gasp_core.stepping.shock import SHOCK_VISCOSITY

__all__ = ["constants", "worded"]

_PRECISION_WORDS: Mapping[bool, Mapping[str, str]] = MappingProxyType(
    {
        False: {
            "REAL": "float",
            "DIGITS": "23",
            "BIAS": "127",
            "TERMS": "5",
            "CONVERGED": "1e-7",
            "LN2_HIGH": "0.693359375",
            "LN2_LOW": "-2.121944400546905827679e-4",
        },
        True: {
            "REAL": "double",
            "DIGITS": "52",
            "BIAS": "1023",
            "TERMS": "10",
            "CONVERGED": "1e-15",
            "LN2_HIGH": "6.93147180369123816490e-01",
            "LN2_LOW": "1.90821492927058770002e-10",
        },
    }
)
"""By whether numbers are doubles: the type, its layout, and where series and iterations end in it."""
_SHARED_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "WELL_SHAPED": "1e-6",
        "SMALLEST_VOLUME": "0.05",
        "FOLDED": f"(REAL){1 - GRADIENT_SHARE!r}",
        "SHARED": f"(REAL){-GRADIENT_SHARE / 4!r}",
        "SHOCK": f"(REAL){4 * SHOCK_VISCOSITY!r}",
        "SHARE": f"(REAL){GRADIENT_SHARE!r}",
    }
)
"""Of both: bounds, and how much of the velocity gradient is that of the slopes."""


def constants(*names: str, **others: int) -> str:
    """Places in rows as `layout` has them under these names, and other numbers, for native code."""
    numbers = {name: getattr(at, name) for name in names} | others
    return "enum { " + ", ".join(f"{name} = {number}" for name, number in numbers.items()) + " };"


def worded(double: bool, text: str, **words: str) -> str:
    """Native code with its words replaced, those of one precision and those given, until none is left."""
    words = words | _SHARED_WORDS | _PRECISION_WORDS[double]
    pattern = re.compile(rf"\b({'|'.join(words)})\b")
    while pattern.search(text):
        text = pattern.sub(lambda found: words[found[0]], text)
    return text
