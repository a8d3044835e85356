"""`help()` tells an engine's author what there is; what is written below a member of an enum it does not show."""

import dataclasses
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

DATACLASSES = [
    kind
    for kind in (getattr(contract, name) for name in contract.__all__)
    if isinstance(kind, type) and dataclasses.is_dataclass(kind)
]


def parameters_of(kind):
    """Names in the section "Parameters" of a class, and of those that it derives from."""
    found = set()
    for text in filter(None, (one.__dict__.get("__doc__") for one in kind.__mro__)):
        section = re.search(
            r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+$|\Z)", inspect.cleandoc(text), re.MULTILINE | re.DOTALL
        )
        for line in section.group(1).splitlines() if section else []:
            if re.match(r"\w", line):
                found |= {name.strip() for name in line.partition(" :")[0].split(",")}
    return found


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


def test_there_are_dataclasses_in_the_contract():
    assert len(DATACLASSES) >= 25


@pytest.mark.parametrize("kind", DATACLASSES, ids=lambda kind: kind.__name__)
def test_help_of_a_dataclass_tells_of_every_field(kind):
    fields = {field.name for field in dataclasses.fields(kind)}
    assert fields - parameters_of(kind) == set()


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
    assert "read" in points
    assert told(text, "checkpoint()")
