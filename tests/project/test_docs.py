"""What README, CONTRIBUTING, CHANGELOG and docs say is there: files, names, commands, keys of scenes.

tests/project/test_readme.py runs what the README shows; here nothing is run.
"""

from __future__ import annotations

import ast
import re
import shlex
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
import pytest

from gasp_core.cli.command_group import gasp
from gasp_core.scene.loading import read_scene

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "conformance_tests/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "plugins").glob("*/README.md")),
]

# A fence may stand in a list.
_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_SHOWN = re.compile(r"`(gasp(?:-conformance)? [^`]+)`")
_PLACEHOLDER = re.compile(r"\.\.\.\s*,\s*|\s*,\s*\.\.\.|\.\.\.")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(language: str) -> list[Any]:
    """Fenced code of a language, each a parameter named by its page and line."""
    found: list[Any] = []
    for page in PAGES:
        text = text_of(page)
        for fence in _FENCE.finditer(text):
            if fence[2] == language:
                line = text.count("\n", 0, fence.start()) + 1
                found.append(pytest.param(fence[3], id=f"{name_of(page)}:{line}"))
    return found


# --- links ----------------------------------------------------------------------------------------------------------


def dead(page: Path, text: str) -> Iterator[str]:
    """Links of a page to what is not there."""
    prose = _FENCE.sub("", text)
    for target in _LINK.findall(prose):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, heading = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.is_relative_to(ROOT) or not file.exists():
            yield f"{target}: no such file"
        elif heading and heading not in headings(text_of(file)):
            yield f"{target}: no such heading"


def headings(text: str) -> set[str]:
    """As a link names them."""
    titles = re.findall(r"^#+ (.*)$", _FENCE.sub("", text), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_to_a_file_leads_to_it(page):
    assert list(dead(page, text_of(page))) == []


def test_a_dead_link_is_noticed():
    text = "[a](nowhere.md), [b](README.md#no-such-heading), [c](README.md#two-commands), [d](https://example.org/e)"
    assert list(dead(ROOT / "README.md", text)) == [
        "nowhere.md: no such file",
        "README.md#no-such-heading: no such heading",
    ]


_PATH = re.compile(r"(?<![\w/.$}-])(?:benchmarks|conformance_tests|docs|examples|gasp_core|plugins|tests)/[\w./-]*\w")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_file_that_is_named_by_its_path_is_there(page):
    # Most paths start at the root; a README in a folder may mean its own.
    missing = {
        path
        for path in _PATH.findall(text_of(page))
        if not any((home / path).exists() for home in (ROOT, page.parent, ROOT / "gasp_core"))
    }
    assert missing == set()


# --- Python ---------------------------------------------------------------------------------------------------------


def imports_of(code: str) -> list[ast.stmt]:
    """The import statements of a block; none where "..." stands for something that is left out.

    Raises
    ------
    SyntaxError
        Where the code, or what is left of it without the dots, is not Python.
    """
    left_out = "..." in code
    tree = ast.parse(_PLACEHOLDER.sub("", code) if left_out else code)
    return [] if left_out else [each for each in ast.walk(tree) if isinstance(each, ast.Import | ast.ImportFrom)]


@pytest.mark.parametrize("code", blocks("python"))
def test_python_compiles_and_imports_what_is_there(code):
    for statement in imports_of(code):
        exec(compile(ast.Module([statement], []), "<block>", "exec"), {})


def test_a_name_that_is_not_there_is_noticed():
    (statement,) = imports_of("from gasp_core.contract import Nonsense\n")
    with pytest.raises(ImportError, match="Nonsense"):
        exec(compile(ast.Module([statement], []), "<block>", "exec"), {})
    with pytest.raises(SyntaxError):
        imports_of("def broken(:\n    ...\n")
    assert imports_of("from somewhere import A, ...\nB(a=1, ...)\n") == []


# --- commands -------------------------------------------------------------------------------------------------------


def commands_in(text: str) -> list[str]:
    """Every line of code that calls `gasp` or `gasp-conformance`, and every such call in the running text."""
    code = [
        line for fence in _FENCE.finditer(text) if fence[2] in ("", "sh", "console") for line in fence[3].split("\n")
    ]
    prose = _FENCE.sub("", text)
    code += re.findall(r"^ {4}(.*)$", prose, flags=re.MULTILINE)
    found: list[str] = _SHOWN.findall(prose)
    for line in code:
        # "A=b .venv/bin/gasp run x | less" is "gasp run x".
        match = re.match(r"\s*(?:\$ )?(?:\w+=\S+ )*(?:\S*/)?(gasp(?:-conformance)? .*)", line)
        if match:
            found.append(match[1])
    return found


def fault_of(line: str) -> str | None:
    """What is wrong with a command line; nothing is run, and no file in it has to be there."""
    first = re.split(r"\s(?:[|>]|&&)\s", line)[0]
    name, *arguments = shlex.split(first, comments=True)
    if name == "gasp-conformance":
        arguments = ["conformance", *arguments]
    command: click.Command = gasp
    context = click.Context(gasp, info_name="gasp")
    try:
        while isinstance(command, click.Group):
            _, arguments, _ = command.make_parser(context).parse_args(args=list(arguments))
            if not arguments:
                return None
            _, below, arguments = command.resolve_command(context, arguments)
            assert below is not None
            context, command = click.Context(below, parent=context, info_name=below.name), below
        given, left, _ = command.make_parser(context).parse_args(args=list(arguments))
    except click.UsageError as error:
        return error.format_message()
    if left:
        return f"unexpected {' '.join(left)}"
    return impossible_choice(command.params, given)


def impossible_choice(parameters: Sequence[click.Parameter], given: dict[str, Any]) -> str | None:
    for parameter in parameters:
        value = given.get(parameter.name or "")
        if isinstance(parameter.type, click.Choice) and isinstance(value, str) and value not in parameter.type.choices:
            return f"{parameter.opts[0]} cannot be {value}"
    return None


# The changelog also tells of commands that are gone.
@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=name_of)
def test_commands_have_the_subcommands_and_options_that_are_shown(page):
    faults = {line: fault for line in commands_in(text_of(page)) if (fault := fault_of(line)) is not None}
    assert faults == {}


def test_there_are_commands_to_look_at():
    # So that a change of style does not make the test above see nothing.
    assert len(commands_in(text_of(ROOT / "README.md"))) > 15
    assert len(commands_in(text_of(ROOT / "docs" / "writing_an_engine.md"))) > 5


@pytest.mark.parametrize(
    "line, fault",
    [
        ("gasp run scene.toml --resolution 24  # quick", None),
        ("gasp engines --json | jq .", None),
        ("gasp engines", None),
        ("gasp-conformance my-engine --quick", None),
        ("gasp walk scene.toml", 'no command "walk"'),
        ("gasp run scene.toml --fast", "No such option"),
        ("gasp engines instal x", "No such command"),
        ("gasp run scene.toml --precision float16", "--precision cannot be float16"),
        ("gasp inspect one.ply two.ply", "unexpected two.ply"),
    ],
)
def test_a_command_that_does_not_exist_is_noticed(line, fault):
    found = fault_of(line)
    assert found is None if fault is None else (found is not None and fault in found)


# --- TOML -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", blocks("toml"))
def test_toml_can_be_read_and_scenes_are_scenes(text):
    tables = tomllib.loads(text)
    if "scene" in tables:
        scene = read_scene(text, file="a page", folder=None)
        assert scene.objects
