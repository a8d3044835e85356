"""`help()` tells an engine's author what there is; what is written below a member of an enum it does not show."""

import enum
import inspect
import pydoc
import re

import pytest

import gasp_core.contract as contract
from gasp_core.stepping.session import SteppedSession

ENUMS = [
    kind
    for kind in (getattr(contract, name) for name in contract.__all__)
    if isinstance(kind, type) and issubclass(kind, enum.Enum)
]


def told(text, name):
    """What stands below a name in a docstring, up to the next one."""
    found = re.search(rf"^ *{re.escape(name)}\n +(\S.*)$", text, flags=re.MULTILINE)
    return found.group(1) if found else ""


def test_there_are_enums_in_the_contract():
    assert len(ENUMS) >= 7


@pytest.mark.parametrize("kind", ENUMS, ids=lambda kind: kind.__name__)
def test_help_of_an_enum_tells_what_each_member_means(kind):
    shown = pydoc.plain(pydoc.render_doc(kind)).replace(" |", "")
    for member in kind:
        assert len(told(shown, member.name).split()) >= 3, f"{kind.__name__}.{member.name} is not explained"


def test_help_of_a_stepped_session_lists_what_can_be_overridden():
    text = inspect.getdoc(SteppedSession)
    points = {name: getattr(SteppedSession, name) for name in SteppedSession.__abstractmethods__}
    # What does nothing of its own is there to be overridden: no code behind its docstring.
    points |= {
        name: function
        for name, function in vars(SteppedSession).items()
        if inspect.isfunction(function) and not name.startswith("_") and not function.__code__.co_names
    }
    assert {"step_toward", "apply_impulse", "begin_advance", "check_state", "warnings", "release"} <= set(points)
    for name, function in points.items():
        parameters = ", ".join(list(inspect.signature(function).parameters)[1:])
        assert told(text, f"{name}({parameters})"), f"{name} is not listed"
    for name in ("read(fields)", "checkpoint()"):
        assert told(text, name)
