"""Reports side by side as Markdown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from gasp_conformance.checks import Level
from gasp_conformance.ledger import Figure
from gasp_conformance.matrix import BEGIN, END, Column, columns_of, main, markdown, spliced
from gasp_conformance.report import (
    CheckResult,
    EngineIdentity,
    Extent,
    Machine,
    Outcome,
    Report,
    ReportError,
    Verdict,
    VerdictOutcome,
    write_report,
)


def result(name: str, outcome: Outcome, value: float | None = None, level: Level = Level.VERIFICATION) -> CheckResult:
    figures = () if value is None else (Figure(case=name, figure="error", value=value, bound=2.0, sense="<="),)
    return CheckResult(name=name, level=level, outcome=outcome, seconds=1.0, figures=figures, reason="it slides")


def report(engine: str, *checks: CheckResult, precision: str = "float64", extent: Extent = Extent.FULL) -> Report:
    return Report(
        suite_version="0.1",
        engine=EngineIdentity(
            name=engine, distribution="d", version="1", contract_version=(1, 0), device="cpu", precision=precision
        ),
        machine=Machine(python="3.11", numpy="2.0", platform="here", processors=2),
        extent=extent,
        verdict=Verdict(outcome=VerdictOutcome.PASSES),
        checks=checks,
        running="",
        finished=True,
    )


FLYER = report(
    "flyer",
    result("lifecycle", Outcome.PASSED, level=Level.CORE),
    result("material:sand", Outcome.PASSED, 0.5, level=Level.CAPABILITY),
    result("material:elastic[soft]", Outcome.PASSED, 1.5, level=Level.CAPABILITY),
    result("V10", Outcome.PASSED, 1.0),
    result("V2[a]", Outcome.PASSED, 0.1),
    result("V2[b]", Outcome.UNDECLARED),
    result("V4", Outcome.UNDECLARED),
    result("agreement[sand]", Outcome.SKIPPED, level=Level.AGREEMENT),
)
SLIDER = report(
    "slider",
    result("lifecycle", Outcome.FAILED, level=Level.CORE),
    result("V2[a]", Outcome.PASSED, 0.1),
    result("V2[b]", Outcome.DEVIATES, 2.5),
    precision="float32",
    extent=Extent.QUICK,
)


FLIES, SLIDES = Column.of(FLYER), Column.of(SLIDER)


def test_checks_by_engines() -> None:
    assert markdown([SLIDES, FLIES]) == (
        "| check | flyer float64 | slider float32, quick |\n"
        "|---|---|---|\n"
        "| **core** | | |\n"
        "| lifecycle | pass | **fails** |\n"
        "| **capability** | | |\n"
        "| material | pass 0.75 |  |\n"
        "| **verification** | | |\n"
        "| V2 | pass 0.05 | deviates |\n"
        "| V4 | not declared |  |\n"
        "| V10 | pass 0.5 |  |\n"
        "| **agreement** | | |\n"
        "| agreement | not run |  |\n"
        "| **verdict** | **passes** | **passes** |\n"
        "\n"
        "- slider float32, quick, V2[b]: error 2.5 <= 2. it slides\n"
    )


def test_two_reports_of_one_engine_are_refused_unless_they_differ() -> None:
    with pytest.raises(ReportError, match="two reports of flyer float64"):
        markdown([FLIES, FLIES])
    assert "| flyer float64 | flyer float64, cuda |" in markdown([FLIES, Column.of(on_cuda(FLYER))])


def on_cuda(one: Report) -> Report:
    return replace(one, engine=replace(one.engine, device="cuda"))


def test_a_table_tells_the_columns_it_was_made_of() -> None:
    deviating = replace(FLYER, checks=(*FLYER.checks, result("V8", Outcome.DEVIATES, 2.5)))
    columns = [Column.of(deviating), Column.of(on_cuda(deviating)), SLIDES]
    assert columns_of(markdown(columns)) == columns
    assert columns_of("nothing yet\n") == []
    with pytest.raises(ReportError, match='1 cells in the row "V10", 2 columns'):
        columns_of(markdown([FLIES, SLIDES]).replace("| V10 | pass 0.5 |  |", "| V10 | pass 0.5 |"))


def test_what_stands_between_the_marks_is_replaced_and_nothing_else() -> None:
    text = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    once = spliced(text, [FLIES], "README")
    assert once == f"before\n{BEGIN}\n{markdown([FLIES])}{END}\nafter\n"
    assert spliced(once, [FLIES], "README") == once


def test_columns_without_a_new_report_stay_and_others_are_replaced() -> None:
    text = spliced(f"{BEGIN}{END}", [FLIES, SLIDES], "README")
    worse = Column.of(replace(SLIDER, checks=(result("V2[a]", Outcome.FAILED),)))
    assert columns_of(spliced(text, [worse], "README")) == [FLIES, worse]


@pytest.mark.parametrize("text", ["", BEGIN, END, f"{END}{BEGIN}", f"{BEGIN}{BEGIN}{END}", f"{BEGIN}{END}{END}"])
def test_marks_that_are_not_there_once_are_refused(text: str) -> None:
    with pytest.raises(ReportError, match="README must hold the lines"):
        spliced(text, [FLIES], "README")


def test_the_command_prints_or_replaces(tmp_path: Path) -> None:
    paths = [str(tmp_path / "a.json"), str(tmp_path / "b.json")]
    for path, one in zip(paths, (FLYER, SLIDER)):
        write_report(one, Path(path))
    printed = CliRunner().invoke(main, paths)
    assert (printed.exit_code, printed.stdout) == (0, markdown([FLIES, SLIDES]))
    readme = tmp_path / "README.md"
    readme.write_text(f"# é\n{BEGIN}\n{END}\n", encoding="utf-8")
    assert CliRunner().invoke(main, [*paths, "--into", str(readme)]).exit_code == 0
    assert readme.read_text(encoding="utf-8") == f"# é\n{BEGIN}\n{markdown([FLIES, SLIDES])}{END}\n"


def test_the_command_says_in_one_line_what_is_wrong(tmp_path: Path) -> None:
    write_report(FLYER, tmp_path / "a.json")
    (tmp_path / "README.md").write_text("no marks\n")
    for arguments in (
        ["missing.json"],
        [str(tmp_path / "a.json"), "--into", str(tmp_path / "README.md")],
        [str(tmp_path / "a.json"), "--into", str(tmp_path / "none.md")],
    ):
        failed = CliRunner().invoke(main, arguments)
        assert failed.exit_code == 1
        assert failed.stderr.startswith("Error: ") and failed.stderr.count("\n") == 1
    assert (tmp_path / "README.md").read_text() == "no marks\n"
