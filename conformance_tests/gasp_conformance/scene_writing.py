"""`--gasp-write-scene`: what a check gives to an engine, as a script that does the same without the suite.

Each session that the check opens becomes a script, `scene-1.py`, `scene-2.py` ..., with its points and other arrays
beside it, `scene-1.npz`: the problem in the contract's own words, the times that the check advances to, and what it
reads there. An author changes it, steps through it in a debugger, or cuts it down to what goes wrong.
"""

from __future__ import annotations

import dataclasses
import difflib
import importlib
import math
import pprint
import textwrap
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from gasp_conformance.collection import collected_checks
from gasp_conformance.subject import Subject
from gasp_core.contract import (
    EngineAccuracy,
    EngineSession,
    Field,
    PointEngine,
    PointProblem,
    PointState,
    StepReport,
)
from gasp_core.io.atomic import replacing

__all__ = ["SceneWriter", "WritingEngine"]

_HOME = "gasp_core.contract"
"""Names are imported from there, where they are public there."""
_WIDTH = 100
_NEAREST = 5


@dataclass(slots=True)
class _Words:
    """Python for the values of the contract; what it imports, and the arrays that it reads, are kept."""

    imports: dict[str, set[str]] = field(default_factory=dict[str, set[str]])
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])

    def of(self, value: Any, name: str = "value") -> str:
        """An expression that makes the value anew; `name` is what an array in it is called."""
        if isinstance(value, Enum):
            return f"{self._imported(type(value))}.{value.name}"
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            given = [(each.name, getattr(value, each.name), each) for each in dataclasses.fields(value) if each.init]
            words = [f"{key}={self.of(item, key)}" for key, item, each in given if not _is_default(item, each)]
            return _call(self._imported(type(value)), words)
        if isinstance(value, np.ndarray):
            called = name
            while called in self.arrays:
                called += "_"
            self.arrays[called] = cast("NDArray[Any]", value)
            return f'ARRAYS["{called}"]'
        if isinstance(value, Mapping):
            items = cast("Mapping[str, Any]", value).items()
            return "{" + ", ".join(f"{key!r}: {self.of(item, key)}" for key, item in items) + "}"
        if isinstance(value, (tuple, frozenset)):
            parts = [self.of(item, name) for item in cast("tuple[Any, ...]", value)]
            if isinstance(value, frozenset):
                return f"frozenset([{', '.join(sorted(parts))}])"
            return _call("", parts) if len(parts) != 1 else f"({parts[0]},)"
        if isinstance(value, (float, np.floating)):
            number = float(value)
            return repr(number) if math.isfinite(number) else f'float("{number}")'
        if isinstance(value, np.generic):
            return repr(value.item())
        return repr(value)

    def _imported(self, kind: type) -> str:
        public = getattr(importlib.import_module(_HOME), kind.__name__, None) is kind
        home = _HOME if public else kind.__module__
        self.imports.setdefault(home, set()).add(kind.__name__)
        return kind.__name__


def _call(name: str, words: list[str]) -> str:
    """A call or a tuple, on a line of its own each where it is long."""
    line = f"{name}({', '.join(words)})"
    if len(line) <= _WIDTH and "\n" not in line:
        return line
    return f"{name}(\n" + textwrap.indent("".join(f"{word},\n" for word in words), "    ") + ")"


def _is_default(value: Any, declared: dataclasses.Field[Any]) -> bool:
    if isinstance(value, np.ndarray):
        return False
    if declared.default_factory is not dataclasses.MISSING:
        return bool(value == declared.default_factory())
    return declared.default is not dataclasses.MISSING and bool(value == declared.default)


@dataclass(slots=True, kw_only=True)
class _Script:
    """A script that grows with what a session is asked."""

    path: Path
    heading: str
    imports: str
    problem: str
    accuracy: str
    engine: str
    times: list[float] = field(default_factory=list[float])
    fields: frozenset[Field] = frozenset({Field.POSITIONS})

    @classmethod
    def begin(
        cls, path: Path, heading: str, problem: PointProblem, accuracy: EngineAccuracy, engine: tuple[Any, ...]
    ) -> _Script:
        """Write the arrays, once, and a script that asks nothing yet."""
        words = _Words(imports={"gasp_conformance.subject": {"find_subject"}, _HOME: {"Field"}})
        script = cls(
            path=path,
            heading=heading,
            problem=words.of(problem),
            accuracy=words.of(accuracy),
            engine=", ".join(words.of(part) for part in engine),
            imports="\n".join(
                f"from {home} import {', '.join(sorted(names))}" for home, names in sorted(words.imports.items())
            ),
        )
        with replacing(path.with_suffix(".npz")) as stream:
            np.savez_compressed(cast("Any", stream), **words.arrays)
        script.write()
        return script

    def write(self) -> None:
        """As far as it goes now."""
        text = f'''"""{self.heading}

    python {self.path.name}
"""

from pathlib import Path

import numpy as np

{self.imports}

ARRAYS = np.load(Path(__file__).with_suffix(".npz"))
PROBLEM = {self.problem}
ACCURACY = {self.accuracy}
TIMES = {pprint.pformat(self.times, width=_WIDTH, compact=True)}
FIELDS = {_Words().of(self.fields)}

with find_subject({self.engine}).open(PROBLEM, ACCURACY, FIELDS) as session:
    for time in TIMES:
        report = session.advance_to(time)
        state = session.read(FIELDS)
        low, high = state.positions.min(axis=0), state.positions.max(axis=0)
        print(f"{{time:.6g}} s  {{report.status.value}}  {{report.substep_count}} substeps  from {{low}} to {{high}} m")
        for warning in report.warnings:
            print(f"    {{warning}}")
'''
        with replacing(self.path) as stream:
            stream.write(text.encode())


@dataclass(slots=True)
class _WritingSession:
    """A session whose script knows what it is asked before it does it: it may take the process down."""

    session: EngineSession
    script: _Script

    def __enter__(self) -> Self:
        self.session.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self.session.__exit__(*raised)

    def advance_to(self, time: float) -> StepReport:
        self.script.times.append(float(time))
        self.script.write()
        return self.session.advance_to(time)

    def read(self, fields: frozenset[Field]) -> PointState:
        if not fields <= self.script.fields:
            self.script.fields |= fields
            self.script.write()
        return self.session.read(fields)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.session, name)


@dataclass(slots=True)
class WritingEngine:
    """An engine that writes a script of every session.

    Parameters
    ----------
    engine
        Which does the work.
    folder
        Where to.
    name
        The engine's.
    check
        Whose sessions these are.
    """

    engine: PointEngine
    folder: Path
    name: str
    check: str
    opened: int = 0

    def open(self, problem: PointProblem, *, accuracy: EngineAccuracy, **rest: Any) -> EngineSession:
        """A session that writes itself down."""
        self.opened += 1
        heading = f'What check "{self.check}" does with {self.name}.'
        if rest.get("restart") is not None:
            heading += " It went on from a checkpoint, which this script does not have: it begins at the start."
        path = self.folder / f"scene-{self.opened}.py"
        script = _Script.begin(path, heading, problem, accuracy, (self.name, rest["precision"], rest["device"]))
        return cast("EngineSession", _WritingSession(self.engine.open(problem, accuracy=accuracy, **rest), script))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.engine, name)


class SceneWriter:
    """pytest hooks of a run that writes what one check does."""

    def __init__(self, name: str, folder: Path) -> None:
        self._name, self._folder = name, folder

    def subject(self, found: Subject) -> Subject:
        """The engine, writing."""
        engine = WritingEngine(found.engine, self._folder, found.name, self._name)
        return dataclasses.replace(found, engine=cast("PointEngine", engine))

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the check.

        Raises
        ------
        pytest.UsageError
            Where no check has the name.
        """
        checks = {one.name: one.item for one in collected_checks(items)}
        if self._name not in checks:
            within = [name for name in checks if self._name.casefold() in name.casefold()]
            close = [*within, *difflib.get_close_matches(self._name, checks, n=_NEAREST)]
            meant = ", ".join(f'"{name}"' for name in dict.fromkeys(close[:_NEAREST]))
            raise pytest.UsageError(
                f'no check is called "{self._name}"; {f"there are {meant}; " if meant else ""}--list shows all names'
            )
        items[:] = [checks[self._name]]
        self._folder.mkdir(parents=True, exist_ok=True)

    @pytest.hookimpl(trylast=True)
    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Tell where it is."""
        count = len(list(self._folder.glob("scene-*.py"))) if self._folder.exists() else 0
        if count:
            terminalreporter.line(f"wrote {count} scene{'s' * (count > 1)} into {self._folder}: python scene-1.py")
        else:
            with suppress(OSError):
                self._folder.rmdir()
            terminalreporter.line(f'check "{self._name}" opened no session in this process: there is nothing to write')
