"""Every check can fail: wrong engines, each caught by the checks named beside it, and by what these say."""

from __future__ import annotations

import importlib.util
import os
import pkgutil
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import gasp_conformance
import pytest
from gasp_conformance.checks import Level
from gasp_conformance.collection import collected_checks

from gasp_core.discovery.registry import discover

pytest_plugins = ["pytester"]

HERE = Path(__file__).parent

# A nested run forgets the modules it was first to import, and compiled ones cannot be imported twice: import them here.
# The suite's tests too, with what assertions have to say: every run would take half a second to rewrite them.
pytest.register_assert_rewrite("gasp_conformance")
MODULES = [
    import_module(f"gasp_conformance.{module.name}")
    for module in pkgutil.iter_modules(gasp_conformance.__path__)
    if not module.name.startswith("__")
]


def _catalogue() -> ModuleType:
    # Test folders are no packages (importlib mode): a neighbour is found by its file.
    home = HERE / "mutants"
    spec = importlib.util.spec_from_file_location(
        "mutants", home / "__init__.py", submodule_search_locations=[str(home)]
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutants"] = module
    spec.loader.exec_module(module)
    return module


MUTANTS: dict[str, Any] = _catalogue().MUTANTS

RIGHT = "reference-mpm"
"""What they all are but for one fault."""

HARMLESS = ("close-twice", "lifecycle", "substep-obeyed")
"""Quick checks, of which every mutant passes one: a fault is one thing, an engine that does nothing right another."""

HASTY = """
import scipy.optimize

from gasp_core.contract import Determinism, EngineCapabilities, EngineDescriptor, Field, Precision
from gasp_core.discovery.hookspecs import hookimpl
from gasp_core.contract import Elastic

@hookimpl
def gasp_point_engines():
    nothing = frozenset()
    capabilities = EngineCapabilities(
        materials=frozenset({Elastic}), collider_shapes=nothing, contact_conditions=nothing, drives=nothing,
        force_fields=nothing, output_fields=frozenset({Field.POSITIONS}), conserved=nothing, devices=("cpu",),
        precisions=(Precision.FLOAT64,), determinism=Determinism.BITWISE)
    return [EngineDescriptor(name="hasty", summary="imports a library to say its name", contract_version=(1, 0),
                             capabilities=capabilities, factory="gasp_reference_mpm.engine:ReferenceMpm")]
"""


class Chosen:
    """Runs the named checks alone and keeps how each ended."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = list(names)
        self.known: dict[str, Level] = {}
        self.endings: dict[str, str] = {}
        self._names: dict[pytest.Item, str] = {}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        found = {one.name: one for one in collected_checks(items)}
        self.known = {name: one.check.level for name, one in found.items()}
        self._names = {found[name].item: name for name in self.names if name in found}
        items[:] = list(self._names)

    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        if call.when == "call" or call.excinfo is not None:
            self.endings[self._names[item]] = "" if call.excinfo is None else _told(call.excinfo)


def _told(failure: pytest.ExceptionInfo[BaseException]) -> str:
    """What a check found, in its own words; begins with "raised" where they are not its own."""
    own = "gasp_conformance" in str(failure.traceback[-1].path)
    if isinstance(failure.value, pytest.fail.Exception) or (own and isinstance(failure.value, AssertionError)):
        return str(failure.value)
    return f"raised {failure.typename}: {failure.value}"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The mutants as distributions that every interpreter finds, this one and those it starts."""
    (tmp_path / "hasty.py").write_text(HASTY)
    for module in ("mutants", "hasty"):
        home = tmp_path / f"gasp_{module}-1.0.dist-info"
        home.mkdir()
        (home / "METADATA").write_text(f"Metadata-Version: 2.1\nName: gasp-{module}\nVersion: 1.0\n")
        (home / "entry_points.txt").write_text(f"[gasp]\n{module} = {module}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{HERE}")
    discover.cache_clear()
    yield
    discover.cache_clear()


@pytest.fixture
def endings(installed: None, pytester: pytest.Pytester) -> Any:
    def run(engine: str, names: Iterable[str], device: str | None = None) -> dict[str, str]:
        chosen = Chosen(names)
        there = () if device is None else (f"--gasp-device={device}",)
        result = pytester.inline_run(
            *("--pyargs", "gasp_conformance", f"--gasp-engine={engine}", f"--gasp-oracle={RIGHT}"),
            *there,
            *("--import-mode=importlib", "-p", "no:cacheprovider", "-q"),
            plugins=[chosen],
        )
        missing = set(chosen.names) - set(chosen.known)
        assert not missing, f"the suite has no check {', '.join(sorted(missing))} for {engine} (status {result.ret})"
        return chosen.endings

    return run


LONG = ("damping", "flow", "flows", "metal", "rigid", "snow", "solvers")
"""Modules of mutants whose checks take seconds, where others take a tenth."""


HALF_A_MINUTE = frozenset(
    {
        *("bodies:separate[slide][0.3]", "bodies:separate[slide][0.5]", "density-ratio", "material:fluid[volume]"),
        *("material:rigid[sand]", "material:rigid[slide]", "material:rigid[spin]", "material:rigid[stack]"),
        *("material:rigid[water]", "material:sand[heap]", "near-incompressible", "pair-contacts"),
    }
)
"""What checks take with the reference engine, or more, though they are quick with others."""


def _slow_ones(kind: Any) -> list[str]:
    return [name for name in kind.caught_by if name in HALF_A_MINUTE or name in kind.slow]


def _caught() -> Iterator[Any]:
    """Every mutant with the checks it is caught by, quick ones and slow ones apart."""
    modules: set[str] = set()
    for kind in MUTANTS.values():
        slow = _slow_ones(kind)
        quick = [name for name in kind.caught_by if name not in slow]
        if quick:
            # One of every module, of few checks, stands for the others while one works on the suite.
            stands = (
                kind.__module__ not in modules and len(quick) == 1 and kind.__module__.rpartition(".")[2] not in LONG
            )
            further = () if stands else (pytest.mark.thorough,)
            modules |= {kind.__module__} if not further else set()
            yield pytest.param(kind, quick, id=kind.name, marks=further)
        if slow:
            yield pytest.param(kind, slow, id=f"{kind.name}, slowly", marks=pytest.mark.slow)


@pytest.mark.parametrize(("kind", "names"), list(_caught()))
def test_mutant_is_caught(endings: Any, kind: Any, names: Sequence[str]) -> None:
    found = endings(kind.name, dict.fromkeys([*names, *HARMLESS]), kind.device)
    assert not all(found[name] for name in HARMLESS), f"{kind.name} does nothing right: {found}"
    for name in names:
        told, says = found[name], kind.caught_by[name]
        assert told, f"{name} lets {kind.name} pass"
        # A crash may only count where the mutant is said to crash.
        assert told.startswith("raised ") == says.startswith("raised "), f"{name} ends otherwise: {told}"
        assert re.search(says, told), f"{name} fails for another reason: {told}"


@pytest.mark.thorough
def test_a_device_that_is_right_hides_one_that_is_not(endings: Any) -> None:
    """What `--device` is for: on its first device the engine passes, and so does the fall that both devices show."""
    kind = MUTANTS["falls-elsewhere"]
    names = [*kind.caught_by, f"device:{kind.device}"]
    assert endings(kind.name, names) == dict.fromkeys(names, "")


@pytest.mark.thorough
def test_columns_that_are_heard_are_believed(endings: Any) -> None:
    names = [f"material-column:{name}" for name in ("density", "poissons_ratio")]
    assert endings("columns-of-stiffness-ignored", names) == dict.fromkeys(names, "")
    names = ["material-column:youngs_modulus"]
    assert endings("columns-of-density-ignored", names) == dict.fromkeys(names, "")


@pytest.mark.thorough
def test_a_second_device_need_not_be_bitwise_and_is_the_same_one_in_every_process(endings: Any) -> None:
    # The last digit is left to chance there; matter that feels its stresses ends far from matter that does not.
    kind = MUTANTS["falls-elsewhere"]
    names = ["determinism", "own-process", "checkpoints", "V16[second run]"]
    assert endings(kind.name, names, kind.device) == dict.fromkeys(names, "")


def test_a_plugin_that_imports_a_library_is_caught(endings: Any) -> None:
    assert re.search(r"importing the plugin imports .*\bscipy\b", endings("hasty", ["discovery"])["discovery"])


def _catching(slow: bool) -> list[str]:
    """The checks they are caught by, as far as they are about what the right engine declares."""
    names = {"discovery", *HARMLESS}
    for kind in MUTANTS.values():
        if kind.right_can:
            found = set(_slow_ones(kind))
            names |= found if slow else kind.caught_by.keys() - found
    return sorted(names)


# Slow, the quick ones too: `make test` has the suite itself judge the right engine.
@pytest.mark.slow
@pytest.mark.parametrize("slow", [False, True], ids=["quick", "slow"])
def test_the_right_engine_passes_what_catches_them(endings: Any, slow: bool) -> None:
    names = _catching(slow)
    assert endings(RIGHT, names) == dict.fromkeys(names, "")


def test_every_core_check_catches_somebody(pytester: pytest.Pytester) -> None:
    chosen = Chosen([])
    pytester.inline_run("--pyargs", "gasp_conformance", f"--gasp-engine={RIGHT}", "-q", plugins=[chosen])
    core = {name for name, level in chosen.known.items() if level is Level.CORE}
    catching = {name for kind in MUTANTS.values() for name in kind.caught_by} | {"discovery"}
    assert core and not core - catching
