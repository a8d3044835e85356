"""Quantities in messages are in the unit that people would take."""

from __future__ import annotations

import pytest

from gasp_core.progress import duration
from gasp_core.quantities import bytes_told, length_told, volume_told


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (bytes_told(0), "0 MB"),
        (bytes_told(3.13e6), "3.13 MB"),
        (bytes_told(373e6), "373 MB"),
        (bytes_told(14.9e9), "14.9 GB"),
        (bytes_told(999.7e6), "1 GB"),
        (length_told(6.43e-5), "0.0643 mm"),
        (length_told(0.0129), "12.9 mm"),
        (length_told(64.3), "64.3 m"),
        (length_told(2345.0), "2.35 km"),
        (volume_told(1.55e-10), "0.155 mm^3"),
        (volume_told(1.24e-3), "1.24 l"),
        (volume_told(3.47e-4), "0.347 l"),
        (volume_told(1.56e8), "156,000,000 m^3"),
        (duration(0), "0.1 s"),
        (duration(3600 * 98), "98 h"),
        (duration(3600 * 230), "9.6 days"),
        (duration(86400 * 1234), "1,200 days"),
    ],
)
def test_a_quantity_is_told_in_its_own_unit(told, expected):
    assert told == expected
