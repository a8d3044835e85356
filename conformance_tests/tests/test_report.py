"""The report as data: figures, JSON and back, what is declared and shown, the verdict, the lines of the table."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from gasp_conformance.checks import Level
from gasp_conformance.declarations import declared, unproven
from gasp_conformance.ledger import Figure, Ledger
from gasp_conformance.report import (
    CheckResult,
    EngineIdentity,
    Extent,
    Machine,
    Outcome,
    Report,
    ReportError,
    Unproven,
    Verdict,
    VerdictOutcome,
    read_report,
    write_report,
)
from gasp_conformance.table import NARROWEST, report_lines
from gasp_conformance.verdict import judge

from gasp_core.contract import (
    ContactCondition,
    Determinism,
    DomainPolicy,
    Elastic,
    EngineCapabilities,
    Field,
    HalfSpace,
    Impulse,
    Precision,
    Quantity,
    Sand,
    Wind,
)
from gasp_core.errors import GaspError


def figure(value: float, bound: float, sense: str = "<=", name: str = "error") -> Figure:
    return Figure(case="V1", figure=name, value=value, bound=bound, sense=sense)  # type: ignore[arg-type]


def result(name: str, outcome: Outcome, level: Level = Level.VERIFICATION, *figures: Figure) -> CheckResult:
    reason = "" if outcome is Outcome.PASSED else "for a reason"
    return CheckResult(name=name, level=level, outcome=outcome, seconds=1.5, figures=figures, reason=reason)


REPORT = Report(
    suite_version="0.1",
    engine=EngineIdentity(
        name="flyer", distribution="flyers", version="2", contract_version=(1, 0), device="cpu", precision="float32"
    ),
    machine=Machine(python="3.11", numpy="2.0", platform="here", processors=2),
    extent=Extent.QUICK,
    verdict=Verdict(outcome=VerdictOutcome.FAILS, reasons=("failed: V2",)),
    checks=(
        result("lifecycle", Outcome.PASSED, Level.CORE),
        result("V1[sand]", Outcome.PASSED, Level.VERIFICATION, figure(0.5, 1.0), figure(math.inf, 1.0)),
        result("V2", Outcome.FAILED, Level.VERIFICATION, figure(math.nan, 1e-5), figure(-math.inf, 2.0, ">=")),
    ),
    unproven=(Unproven(capability="device:moon", reason="not on this machine", excused=True),),
    running="",
    finished=True,
)


@pytest.mark.parametrize(
    ("one", "holds", "share"),
    [
        (figure(0.5, 1.0), True, 0.5),
        (figure(-2.0, 1.0), False, 2.0),
        (figure(0.0, 0.0), True, 0.0),
        (figure(1e-300, 0.0), False, math.inf),
        (figure(math.nan, 1.0), False, math.inf),
        (figure(2.0, 1.8, ">="), True, 0.9),
        (figure(0.9, 1.8, ">="), False, 2.0),
        (figure(-1.0, 1.8, ">="), False, math.inf),
        (figure(-1.0, -2.0, ">="), True, 0.0),
        (figure(-3.0, -2.0, ">="), False, math.inf),
        (figure(math.nan, 1.8, ">="), False, math.inf),
    ],
)
def test_a_figure_holds_exactly_where_it_uses_no_more_than_its_bound(one: Figure, holds: bool, share: float) -> None:
    assert one.holds is holds
    assert one.share == pytest.approx(share)
    assert holds == (one.share <= 1)


def test_a_ledger_records_before_it_judges() -> None:
    entries: list[tuple[str, object]] = []
    ledger = Ledger(lambda name, value: entries.append((name, value)))
    ledger.at_most("V1", "error", -0.5, 0.5)
    ledger.at_least("V3", "order", 2.0, 1.8)
    with pytest.raises(AssertionError, match=r"^V1: error is 0\.6, bound 0\.5"):
        ledger.at_most("V1", "error", 0.6, 0.5)
    with pytest.raises(AssertionError, match=r"^V1: error is nan"):
        ledger.at_most("V1", "error", math.nan, 0.5)
    with pytest.raises(AssertionError, match=r"^V3: order is 1\.7"):
        ledger.at_least("V3", "order", 1.7, 1.8)
    assert [value.value for _, value in entries[:4]] == [-0.5, 2.0, 0.6, pytest.approx(math.nan, nan_ok=True)]  # type: ignore[attr-defined]
    assert len(entries) == 5


def test_json_and_back_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_report(REPORT, path)
    again = read_report(path)
    # A NaN is not equal to itself; everything else is.
    assert repr(again) == repr(REPORT)
    assert [file.name for file in tmp_path.iterdir()] == ["report.json"]


def test_json_is_json_even_with_numbers_it_does_not_have(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_report(REPORT, path)

    def refuse(name: str) -> float:
        raise AssertionError(f"{name} is no JSON")

    document = json.loads(path.read_text(), parse_constant=refuse)
    assert document["format"] == "gasp-conformance-report" and document["version"] == 1
    assert document["engine"]["contract_version"] == [1, 0]
    assert document["verdict"] == {"outcome": "fails", "reasons": ["failed: V2"]}
    assert document["checks"][1]["outcome"] == "passed" and document["checks"][1]["level"] == "verification"
    assert document["checks"][1]["figures"][0] == {
        "case": "V1",
        "figure": "error",
        "value": 0.5,
        "bound": 1.0,
        "sense": "<=",
    }
    assert [one["value"] for one in document["checks"][2]["figures"]] == ["NaN", "-Infinity"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is not JSON"),
        ("[]", "is no report of the suite"),
        ('{"format": "x"}', "is no report of the suite"),
        ('{"format": "gasp-conformance-report", "version": 9}', "version 9, this suite reads 1"),
        ('{"format": "gasp-conformance-report", "version": 1}', "damaged report"),
        ('{"format": "gasp-conformance-report", "version": 1, "engine": 3}', "damaged report"),
    ],
)
def test_what_is_no_report_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(ReportError, match=said) as refused:
        read_report(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_a_missing_report_and_a_missing_folder_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="No such file"):
        read_report(tmp_path / "report.json")
    with pytest.raises(GaspError, match="cannot be written"):
        write_report(REPORT, tmp_path / "nowhere" / "report.json")


CAN = EngineCapabilities(
    materials=frozenset({Elastic, Sand}),
    collider_shapes=frozenset({HalfSpace}),
    contact_conditions=frozenset({ContactCondition.STICK}),
    drives=frozenset({Impulse}),
    force_fields=frozenset({Wind}),
    output_fields=frozenset({Field.POSITIONS, Field.VELOCITIES}),
    conserved=frozenset({Quantity.LINEAR_MOMENTUM}),
    devices=("cpu", "cuda"),
    precisions=(Precision.FLOAT32, Precision.FLOAT64),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset({DomainPolicy.STOP}),
    carries_tracers=True,
    checkpoints=True,
)


def test_every_declaration_has_the_name_of_its_check() -> None:
    assert declared(CAN, Precision.FLOAT32) == [
        "material:elastic",
        "material:sand",
        "collider:plane",
        "walls:stick",
        "drive:impulse",
        "force-field:wind",
        "field:velocities",
        "conserved:linear_momentum",
        "device:cpu",
        "device:cuda",
        "precision:float64",
        "domain:stop",
        "checkpoints",
        "tracers",
    ]
    little = declared(replace(CAN, checkpoints=False, carries_tracers=False), Precision.FLOAT64)
    assert little[-1] == "domain:stop" and "precision:float32" in little and "precision:float64" not in little


def test_a_capability_is_shown_by_a_check_of_that_level_that_passed() -> None:
    capability = Level.CAPABILITY
    results = [
        result("material:elastic[stiff]", Outcome.UNDECLARED, capability),
        result("material:elastic[soft]", Outcome.PASSED, capability),
        result("material:sand", Outcome.FAILED, capability),
        result("drive:impulse", Outcome.PASSED, Level.EXTREMES),
        replace(result("device:cuda", Outcome.SKIPPED, capability), reason="not on this machine: no GPU"),
        replace(result("device:cpu", Outcome.SKIPPED, capability), reason="not today"),
        replace(result("tracers", Outcome.SKIPPED, capability), reason="not on this machine"),
    ]
    names = ["material:elastic", "material:sand", "drive:impulse", "device:cuda", "device:cpu", "tracers", "field:x"]
    found = unproven(names, results, left_out=["field:x[long]"])
    assert [(one.capability, one.excused) for one in found] == [
        ("material:sand", False),
        ("drive:impulse", False),
        ("device:cuda", True),
        ("device:cpu", False),
        ("tracers", False),
        ("field:x", True),
    ]
    assert [one.reason for one in found][:3] == ["its check failed", "no check shows it", "not on this machine: no GPU"]


def test_a_verdict_passes_only_where_nothing_speaks_against_it() -> None:
    good = [
        result("drift", Outcome.PASSED, Level.CORE),
        result("V5", Outcome.DEVIATES),
        result("V6", Outcome.UNDECLARED),
        result("agreement", Outcome.SKIPPED, Level.AGREEMENT),
    ]
    excused = Unproven(capability="device:moon", reason="not on this machine", excused=True)
    nothing: dict[str, list[str]] = {"unrun": [], "broken": [], "unknown": []}
    assert judge(good, **nothing, unproven=[excused], complete=True) == Verdict(outcome=VerdictOutcome.PASSES)
    assert judge(good, **nothing, unproven=[], complete=False).outcome is VerdictOutcome.PARTIAL
    for bad in (
        judge([*good, result("V1", Outcome.FAILED)], **nothing, unproven=[], complete=True),
        judge([*good, result("V1", Outcome.STALE)], **nothing, unproven=[], complete=True),
        judge([*good, result("V1", Outcome.ERROR)], **nothing, unproven=[], complete=False),
        judge(good, **{**nothing, "unrun": ["V1"]}, unproven=[], complete=True),
        judge(good, **{**nothing, "broken": ["V1"]}, unproven=[], complete=True),
        judge(good, **{**nothing, "unknown": ["V1"]}, unproven=[], complete=True),
        judge(good, **nothing, unproven=[replace(excused, capability="V1", excused=False)], complete=True),
    ):
        assert bad.outcome is VerdictOutcome.FAILS
        assert len(bad.reasons) == 1 and "V1" in bad.reasons[0]
    assert judge(good[1:], **nothing, unproven=[], complete=True).reasons == ("no core check ran",)


def test_the_table_fits_a_terminal_and_shows_the_worst_figure() -> None:
    long = result(
        "V16[" + "rotation by an odd angle " * 4 + "]",
        Outcome.PASSED,
        Level.VERIFICATION,
        figure(0.1, 1.0, name="a mild one"),
        figure(0.9, 1.0, name="a very long name of a figure that says what was measured, and where, and how"),
    )
    report = replace(REPORT, checks=(*REPORT.checks, long, replace(result("V9", Outcome.ERROR), reason="word " * 60)))
    lines = [line.text for line in report_lines(report, 10)]
    assert max(len(line) for line in lines) <= NARROWEST
    text = "\n".join(lines)
    assert "core          lifecycle" in text
    (row,) = (line for line in lines if line.startswith("verification  V16"))
    assert "0.9 <= 1" in row and "…" in row
    (row,) = (line for line in lines if line.startswith("verification  V2 "))
    assert "failed" in row and "error nan <= 1e-05" in row
    assert text.count("word") >= 60
    assert "device:moon not shown: not on this machine" in text
    assert "flyer (float32, cpu, quick): fails (3 passed, 1 failed, 1 error)" in text
    assert lines[-1] == "- failed: V2"


def test_where_there_is_no_terminal_nothing_is_cut_or_broken() -> None:
    sentence = "flyer does not declare that bodies separate from each other where they touch, " * 2
    named = "V16[" + "rotation by an odd angle " * 4 + "]"
    undeclared = replace(result(named, Outcome.UNDECLARED), reason=sentence)
    failed = replace(result("V9", Outcome.FAILED), reason=sentence)
    lines = [line.text for line in report_lines(replace(REPORT, checks=(undeclared, failed)))]
    (row,) = (line for line in lines if line.startswith("verification  V16"))
    assert named in row and sentence.strip() in row
    assert f"V9 failed: {sentence.strip()}" in lines


def test_colours_say_what_the_words_say() -> None:
    colours = {line.text: line.colour for line in report_lines(REPORT)}
    assert colours["- failed: V2"] == "red"
    passing = replace(REPORT, verdict=Verdict(outcome=VerdictOutcome.PASSES))
    assert list(report_lines(passing))[-1].colour == "green"
