"""What a worker may answer, and what counts as no answer at all."""

import json
import math

import numpy as np
import pytest

from gasp_core.contract import Status, StepReport
from gasp_core.engines.worker import replies
from gasp_core.engines.worker.serialization import to_plain
from gasp_core.engines.worker.shared_memory import Block


def sent(report):
    """As it comes through the pipe."""
    return json.loads(json.dumps(to_plain(report, {})))


@pytest.mark.parametrize(
    ("status", "substeps", "step", "residual"),
    [
        (Status.NOT_CONVERGED, 3, 1e-3, math.inf),
        (Status.NON_FINITE, 3, math.inf, math.nan),
        (Status.SUBSTEP_LIMIT, 0, math.inf, None),
        (Status.OK, 0, math.inf, 0.0),
    ],
)
def test_a_report_of_a_failure_is_a_report(status, substeps, step, residual):
    report = StepReport(
        status=status, substep_count=substeps, smallest_substep=step, largest_substep=1.0, solver_residual=residual
    )
    assert repr(replies.report(sent(report))) == repr(report)


@pytest.mark.parametrize("step", [math.inf, math.nan])
def test_steps_that_were_taken_have_a_size(step):
    report = StepReport(status=Status.OK, substep_count=3, smallest_substep=step, largest_substep=1.0)
    with pytest.raises(ValueError, match="smallest_substep is no number"):
        replies.report(sent(report))


@pytest.mark.parametrize("kind", ["int32, (", "O", "V8", "S0", "U", "f3", "float64", "(2,)f8", "f8,f8", "", 3])
def test_a_type_that_is_not_of_numbers_or_text_is_none(kind):
    with pytest.raises(ValueError, match=r"is of no type|a type is no text"):
        replies.any_layout({"layout": {"x": [kind, [2], 0]}})


def test_many_arrays_over_the_same_memory_are_refused():
    block = Block.make()
    block.pack({"x": np.zeros(1000)})
    layout = {f"x{number}": ("<f8", [1000], 0) for number in range(100)}
    with pytest.raises(ValueError, match="more than the memory holds"):
        block.unpack(layout)
    assert len(block.unpack({"x": ("<f8", [1000], 0), "y": ("<f4", [0], 0)})) == 2
    block.close()
