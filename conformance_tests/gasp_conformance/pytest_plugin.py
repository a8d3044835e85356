"""pytest plugin: which engine the suite looks at, and with what.

    pytest --pyargs gasp_conformance --gasp-engine=NAME

It is loaded into every pytest run where the suite is installed, so it imports nothing of it until an engine is named.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gasp_conformance.checks import MARK
from gasp_conformance.ledger import Ledger

if TYPE_CHECKING:
    from gasp_conformance.subject import Need, Subject

__all__ = ["Ledger", "ledger", "need", "oracle", "subject", "subject_of"]

_SUBJECT = pytest.StashKey["Subject | None"]()
_ORACLE = pytest.StashKey["Subject | None"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of the suite."""
    group = parser.getgroup("gasp", "conformance of GASP point engines")
    group.addoption("--gasp-engine", metavar="NAME", help="the engine to look at, as `gasp engines` lists it")
    group.addoption("--gasp-oracle", metavar="NAME", help="an engine of the same method, to compare it with")
    group.addoption(
        "--gasp-precision",
        choices=("float32", "float64"),
        help="precision to run the engine in (default: the first it declares)",
    )
    group.addoption("--gasp-device", metavar="DEVICE", help="device to run it on (default: the first it declares)")
    group.addoption("--gasp-isolate", action="store_true", help="open every session in a process of its own")
    group.addoption("--gasp-quick", action="store_true", help="leave out the checks that take long")
    group.addoption("--gasp-report", metavar="FILE", type=Path, help="write what was found as JSON")
    group.addoption("--gasp-write-scene", metavar="CHECK", help="run that check alone, and write what it does")
    group.addoption("--gasp-scenes", metavar="FOLDER", type=Path, help="where to (default: scenes)")
    group.addoption("--gasp-list", action="store_true", help="list the checks and run none")


def pytest_configure(config: pytest.Config) -> None:
    """Find the engines before anything is collected, so that a misspelt name is one line and not a page."""
    config.addinivalue_line("markers", f"{MARK}(check): a check of the suite")
    config.stash[_SUBJECT] = config.stash[_ORACLE] = None
    name, report = config.getoption("--gasp-engine"), config.getoption("--gasp-report")
    if name is not None:
        _find(config, name)
    elif report is not None:
        raise pytest.UsageError("--gasp-report needs --gasp-engine=NAME")
    if config.getoption("--gasp-list"):
        from gasp_conformance.listing import Listing

        config.pluginmanager.register(Listing(), "gasp-listing")
    elif name is not None:
        _examine(config, report)
        if config.getoption("--gasp-write-scene"):
            _write_scenes(config)


def _find(config: pytest.Config, name: str) -> None:
    from gasp_conformance.subject import find_subject, isolated_subject
    from gasp_core.contract import Precision
    from gasp_core.errors import GaspError

    precision, device = config.getoption("--gasp-precision"), config.getoption("--gasp-device")
    oracle = config.getoption("--gasp-oracle")
    find = isolated_subject if config.getoption("--gasp-isolate") else find_subject
    try:
        config.stash[_SUBJECT] = find(name, Precision(precision) if precision else None, device)
        config.stash[_ORACLE] = find_subject(oracle, None, None) if oracle else None
    except GaspError as error:
        raise pytest.UsageError(str(error)) from None


def _write_scenes(config: pytest.Config) -> None:
    from gasp_conformance.scene_writing import SceneWriter

    found = config.stash[_SUBJECT]
    assert found is not None
    folder: Path = config.getoption("--gasp-scenes") or Path("scenes")
    writer = SceneWriter(config.getoption("--gasp-write-scene"), folder)
    config.stash[_SUBJECT] = writer.subject(found)
    config.pluginmanager.register(writer, "gasp-scene-writer")


def _examine(config: pytest.Config, report: Path | None) -> None:
    from gasp_conformance.deviations import deviations_of
    from gasp_conformance.examination import Examination
    from gasp_conformance.report import Extent
    from gasp_core.errors import GaspError

    if config.getoption("numprocesses", None):
        raise pytest.UsageError("the suite runs its checks in one process, in their order: leave out -n")
    found = config.stash[_SUBJECT]
    assert found is not None
    try:
        known = deviations_of(found.descriptor, found.distribution)
        examination = Examination(
            found,
            oracle=config.stash[_ORACLE],
            deviations=[one for one in known if one.applies(found.precision, found.device)],
            extent=Extent.QUICK if config.getoption("--gasp-quick") else Extent.FULL,
            path=report,
        )
    except GaspError as error:
        raise pytest.UsageError(str(error)) from None
    config.pluginmanager.register(examination, "gasp-examination")


def subject_of(config: pytest.Config) -> Subject | None:
    """The engine the suite looks at, for checks that are made for what it declares; None without --gasp-engine."""
    return config.stash[_SUBJECT]


@pytest.fixture
def subject(pytestconfig: pytest.Config) -> Subject:
    """The engine the suite looks at."""
    found = pytestconfig.stash[_SUBJECT]
    if found is None:
        pytest.skip("no engine named: run with --gasp-engine=NAME")
    return found


@pytest.fixture
def oracle(pytestconfig: pytest.Config) -> Subject:
    """The engine it is compared with."""
    found = pytestconfig.stash[_ORACLE]
    if found is None:
        pytest.skip("no engine to compare with: run with --gasp-oracle=NAME")
    return found


@pytest.fixture
def need(subject: Subject) -> Need:
    """Ends a check as undeclared unless the engine declares what it is about."""

    from gasp_conformance.subject import Undeclared

    def ask(has: bool, what: str) -> None:
        if not has:
            raise Undeclared(f"{subject.name} does not declare {what}")

    return ask


@pytest.fixture
def ledger(record_property: Any) -> Ledger:
    """Where figures are recorded and judged."""
    return Ledger(record_property)
