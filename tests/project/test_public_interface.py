"""What is public is written down, and cannot change without a word in the changelog.

docs/public_interface.txt has one line for each public thing, as this file finds them. Its first line is a digest of the
"Public interface" entry of the newest version in CHANGELOG.md, so that both change together:

    python tests/project/test_public_interface.py

writes it anew, and refuses to where the interface has changed and that entry has not.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import hashlib
import importlib
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import click
import pytest

from gasp_core.cli.command_group import BUILT_IN
from gasp_core.cli.command_group import gasp as gasp_command

ROOT = Path(__file__).parents[2]
CHANGELOG = ROOT / "CHANGELOG.md"
WRITTEN = ROOT / "docs" / "public_interface.txt"
RENEW = "python tests/project/test_public_interface.py"

MODULES = (
    "gasp_core.contract",
    "gasp_core.errors",
    "gasp_core.stepping.checkpoint",
    "gasp_core.stepping.embedding",
    "gasp_core.stepping.enclosure",
    "gasp_core.stepping.forcing",
    "gasp_core.stepping.neighbours",
    "gasp_core.stepping.session",
    "gasp_core.stepping.signed_distances",
    "gasp_core.stepping.rigid_motion",
    "gasp_core.stepping.voxel_cage",
    "gasp_core.discovery.hookspecs",
    "gasp_core.rendering.contract",
    "gasp_core",
)
"""All of whose `__all__` is public."""

OUR_COMMANDS = (*BUILT_IN, "conformance", "view")
"""Those of GASP's own distributions; what else is installed may add to them."""


# --- the changelog --------------------------------------------------------------------------------------------------


def interface_entry(changelog: str) -> str:
    """What the newest version in a changelog says under "Public interface"; nothing where it says nothing."""
    newest = re.split(r"^## ", changelog, flags=re.MULTILINE)[1]
    for section in re.split(r"^### ", newest, flags=re.MULTILINE)[1:]:
        title, _, text = section.partition("\n")
        if title.strip() == "Public interface":
            return text.strip()
    return ""


def first_line(entry: str) -> str:
    """That of docs/public_interface.txt for an entry of the changelog; line ends and indents are not its sense."""
    digest = hashlib.sha256(" ".join(entry.split()).encode()).hexdigest()[:16]
    return f'# with "Public interface" in CHANGELOG.md, digest {digest}'


def renewed(found: list[str], entry: str, written: str) -> str:
    """The text anew.

    Raises
    ------
    ValueError
        Where the interface has changed since `written`, and the entry has not.
    """
    head, *before = written.splitlines() or [""]
    if found != before and head == first_line(entry):
        raise ValueError(
            f"{CHANGELOG.name}: the public interface has changed, and the newest version says nothing new of it:"
            ' write under its heading "### Public interface" what a user or an author of an engine has to know'
        )
    return "\n".join([first_line(entry), *found]) + "\n"


# --- the interface --------------------------------------------------------------------------------------------------


def interface() -> list[str]:
    """One line for every public thing."""
    known: dict[int, str] = {}
    lines = [line for module in MODULES for line in module_lines(module, known)]
    for name in sorted(OUR_COMMANDS):
        command = gasp_command.get_command(click.Context(gasp_command), name)
        assert command is not None, f'"gasp {name}" is not there: install all of the project, "make install"'
        lines += command_lines(f"gasp {name}", command)
    return lines


def module_lines(name: str, known: dict[int, str]) -> Iterator[str]:
    """The names that a module has in `__all__`; a class or function that has a name already is told by that one."""
    module = importlib.import_module(name)
    for public in sorted(module.__all__):
        # What Numba has compiled is told as what it was compiled from.
        thing = getattr(module, public)
        thing, full = getattr(thing, "py_func", thing), f"{name}.{public}"
        if id(thing) in known:
            yield f"{full} = {known[id(thing)]}"
        else:
            yield from thing_lines(full, thing)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            known[id(thing)] = full


def thing_lines(name: str, thing: Any) -> Iterator[str]:
    if inspect.isclass(thing):
        yield from class_lines(name, thing)
    elif inspect.isfunction(thing):
        yield f"{name}{signature(thing)}"
    else:
        yield f"{name} = {value_text(thing)}"


def class_lines(name: str, kind: type[Any]) -> Iterator[str]:
    """A class with its fields or members, then its public methods and properties, its own and inherited ones."""
    if issubclass(kind, Enum):
        yield f"{name}: {', '.join(f'{member.name} = {member.value!r}' for member in kind)}"
        return
    parents = ", ".join(base.__name__ for base in kind.__bases__ if base is not object and base.__name__[0] != "_")
    head = f"{name}({parents})" if parents else name
    made = "__init__" in vars(kind) and not getattr(kind, "_is_protocol", False)
    yield f"{head} with {signature(kind.__init__)}" if made else head
    fields = {field.name for field in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    for public in sorted(one for one in dir(kind) if not one.startswith("_") and one not in fields):
        member = inspect.getattr_static(kind, public)
        # What Exception brings is Python's.
        if not any(public in vars(base) for base in kind.__mro__ if base.__module__.startswith("gasp_core")):
            continue
        if isinstance(member, (property, functools.cached_property)):
            getter: Any = member.fget if isinstance(member, property) else member.func
            yield f"{name}.{public}: {annotation(inspect.signature(getter).return_annotation)}"
        elif isinstance(member, (staticmethod, classmethod)):
            yield f"{name}.{public}{signature(member.__func__)}"
        elif inspect.isfunction(member):
            to_write = getattr(member, "__isabstractmethod__", False)
            yield f"{name}.{public}{signature(member)}{', to be written' if to_write else ''}"
        else:
            yield f"{name}.{public} = {value_text(member)}"


def signature(function: Any) -> str:
    """As it is written, but for `self`: the same under every Python."""
    found = inspect.signature(function)
    words: list[str] = []
    kinds = inspect.Parameter
    starred = False
    for parameter in found.parameters.values():
        if parameter.name in ("self", "cls") and not words:
            continue
        if parameter.kind is kinds.KEYWORD_ONLY and not starred:
            words.append("*")
            starred = True
        starred |= parameter.kind is kinds.VAR_POSITIONAL
        prefix = {kinds.VAR_POSITIONAL: "*", kinds.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        word = f"{prefix}{parameter.name}"
        if parameter.annotation is not parameter.empty:
            word += f": {annotation(parameter.annotation)}"
        if parameter.default is not parameter.empty:
            word += f" = {value_text(parameter.default)}"
        words.append(word)
    back = found.return_annotation
    told = "" if back in (found.empty, None, "None") else f" -> {annotation(back)}"
    return f"({', '.join(words)}){told}"


def annotation(hint: Any) -> str:
    return hint if isinstance(hint, str) else getattr(hint, "__name__", str(hint))


def value_text(value: Any) -> str:
    """A value, without what differs from one process or one Python to the next."""
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, (frozenset, set)):
        return "{" + ", ".join(sorted(map(value_text, value))) + "}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {value_text(each)}" for key, each in value.items()) + "}"
    if isinstance(value, (tuple, list)):
        return "(" + ", ".join(map(value_text, value)) + ")"
    if inspect.isclass(value) or inspect.isfunction(value):
        return value.__name__
    # An object without a text of its own has an address in it; what a factory makes has no text before it is made.
    text = " ".join(repr(value).split())
    return "..." if text.startswith("<") else text


def command_lines(name: str, command: click.Command) -> Iterator[str]:
    """A command with its arguments, then each of its options, then the commands below it."""
    arguments = [one for one in command.params if isinstance(one, click.Argument)]
    yield " ".join([name, *(argument_text(one) for one in arguments)])
    for option in command.params:
        if isinstance(option, click.Option):
            yield f"{name} {option_text(option)}"
    if isinstance(command, click.Group):
        for below in sorted(command.commands):
            yield from command_lines(f"{name} {below}", command.commands[below])


def argument_text(argument: click.Argument) -> str:
    name = (argument.name or "").upper() + ("..." if argument.nargs == -1 else "")
    return name if argument.required else f"[{name}]"


def option_text(option: click.Option) -> str:
    words = ["/".join([*sorted(option.opts, key=len, reverse=True), *option.secondary_opts])]
    if not option.is_flag:
        choice = option.type
        words.append(f"[{'|'.join(map(str, choice.choices))}]" if isinstance(choice, click.Choice) else choice.name)
        if isinstance(option.default, (str, int, float)) and not isinstance(option.default, bool):
            words.append(f"= {option.default}")
    words += ["again and again"] * option.multiple + ["required"] * option.required
    return " ".join(words)


# --- tests ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def entry() -> str:
    return interface_entry(CHANGELOG.read_text(encoding="utf-8"))


def test_the_interface_is_what_is_written_down():
    before = WRITTEN.read_text(encoding="utf-8").splitlines()[1:]
    found = interface()
    if found != before:
        # Behind the two lines that name the files.
        change = list(difflib.unified_diff(before, found, lineterm="", n=0))[2:]
        pytest.fail(
            "the public interface has changed:\n"
            + "\n".join(line for line in change if not line.startswith("@@"))
            + f'\nSay so under "### Public interface" of the newest version in CHANGELOG.md, then: {RENEW}',
            pytrace=False,
        )


def test_it_was_written_down_with_the_changelog_of_today(entry):
    head = WRITTEN.read_text(encoding="utf-8").splitlines()[0]
    assert head == first_line(entry), f'"Public interface" in CHANGELOG.md has changed since: {RENEW}'


def test_the_newest_version_in_the_changelog_is_that_of_the_project_or_the_one_to_come():
    versions = re.findall(r"^## \[?(\d+)\.(\d+)\.(\d+)", CHANGELOG.read_text(encoding="utf-8"), flags=re.MULTILINE)
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    ((*own, coming),) = re.findall(r'^version = "(\d+)\.(\d+)\.(\d+)(\.dev0)?"', text, flags=re.MULTILINE)
    numbers = [tuple(map(int, version)) for version in versions]
    assert numbers == sorted(numbers, reverse=True), "the newest version comes first"
    assert tuple(map(int, own)) in numbers[: 1 if coming else 2], (
        f"version {'.'.join(own)} of pyproject.toml has no section"
    )


def test_a_change_without_a_word_in_the_changelog_cannot_be_written_down():
    before = renewed(["gasp run SCENE"], "- `gasp run`", "")
    with pytest.raises(ValueError, match="says nothing new"):
        renewed(["gasp run SCENE --fast"], "- `gasp run`", before)
    after = renewed(["gasp run SCENE --fast"], "- `gasp run --fast`", before)
    assert after.splitlines()[1:] == ["gasp run SCENE --fast"]
    assert after.splitlines()[0] != before.splitlines()[0]


def test_only_the_entry_of_the_newest_version_counts():
    older = "## 0.1.0\n\n### Public interface\n\n- old\n"
    fixed = "### Fixed\n\n- x\n\n"
    assert interface_entry(f"# C\n\n## 0.2.0\n\n### Public interface\n\n- new\n\n{fixed}{older}") == "- new"
    assert interface_entry(f"# C\n\n## 0.2.0\n\n{fixed}{older}") == ""


def test_the_text_has_no_address_and_no_path_of_this_machine():
    text = "\n".join(interface())
    assert " at 0x" not in text
    assert str(Path.home()) not in text.split()
    assert str(ROOT) not in text


if __name__ == "__main__":
    try:
        WRITTEN.write_text(
            renewed(
                interface(),
                interface_entry(CHANGELOG.read_text(encoding="utf-8")),
                WRITTEN.read_text(encoding="utf-8") if WRITTEN.exists() else "",
            ),
            encoding="utf-8",
        )
    except ValueError as refusal:
        sys.exit(str(refusal))
