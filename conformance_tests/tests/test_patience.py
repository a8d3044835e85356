"""What is said of a check that does not come back."""

from __future__ import annotations

import time

from gasp_conformance.patience import waiting


def test_a_check_that_goes_on_is_named_again_and_again():
    said = []
    with waiting("V99[hangs]", said.append, first=0.02):
        time.sleep(0.5)
    count = len(said)
    # After .02, .06, .14 and .30 s, on a machine that keeps up.
    assert 1 <= count <= 5
    assert all(line.startswith("V99[hangs] has been going on for 0 min") for line in said)
    time.sleep(0.1)
    assert len(said) == count


def test_nothing_is_said_of_one_that_comes_back():
    said = []
    with waiting("V99", said.append):
        pass
    assert said == []
