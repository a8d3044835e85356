"""An engine's own options: known names, right types, the plugin's own refusals."""

import dataclasses
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gasp_core.contract.options import build_options
from gasp_core.contract.validation import finite
from gasp_core.errors import SceneError


class Solver(Enum):
    DIRECT = "direct"
    ITERATIVE = "iterative"


@dataclass(frozen=True, kw_only=True)
class Options:
    threads: int = 0
    damping: float = 0.0
    fast: bool = False
    label: str = ""
    solver: Solver = Solver.DIRECT
    scheme: Literal["flip", "apic"] = "apic"
    cache: Path | None = None
    substep: float | None = None
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    layers: tuple[int, ...] = ()

    def __post_init__(self):
        finite(self, "damping", low=0.0, high=1.0)
        if self.threads > 64:
            raise ValueError("threads above 64 are not for this machine")


@pytest.fixture
def engine(fake_module):
    (descriptor,) = fake_module("ballistic", "fake_ballistic").gasp_point_engines()
    return dataclasses.replace(descriptor, options=Options)


def test_nothing_given_is_the_defaults(engine):
    assert build_options(engine, {}) == Options()
    assert build_options(engine) == Options()


def test_every_kind_of_value(engine):
    table = {
        "threads": 2,
        "damping": 1,
        "fast": True,
        "label": "x",
        "solver": "iterative",
        "scheme": "flip",
        "cache": "here",
        "substep": 1e-4,
        "spin": [1, 2.5, 3],
        "layers": [1, 2],
    }
    assert build_options(engine, table) == Options(
        threads=2,
        damping=1.0,
        fast=True,
        label="x",
        solver=Solver.ITERATIVE,
        scheme="flip",
        cache=Path("here"),
        substep=1e-4,
        spin=(1.0, 2.5, 3.0),
        layers=(1, 2),
    )
    assert type(build_options(engine, {"damping": 1}).damping) is float


def test_numbers_of_numpy_become_python_s_own(engine):
    options = build_options(engine, {"threads": np.int64(2), "damping": np.float32(0.5)})
    assert (options.threads, options.damping) == (2, 0.5)
    assert type(options.threads) is int and type(options.damping) is float


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"thread": 2}, r'unknown option "thread"; known are threads, damping, .*\(did you mean "threads"\?\)'),
        ({"threads": 2.0}, r"threads must be a whole number, found 2\.0"),
        ({"threads": True}, r"threads must be a whole number, found True"),
        ({"damping": "much"}, r"damping must be a number, found 'much'"),
        ({"damping": False}, r"damping must be a number, found False"),
        ({"fast": 1}, r"fast must be true or false, found 1"),
        ({"label": 1}, r"label must be a string, found 1"),
        ({"solver": "magic"}, r"solver must be one of 'direct', 'iterative', found 'magic'"),
        ({"solver": ["direct"]}, r"solver must be one of"),
        ({"scheme": "pic"}, r"scheme must be one of 'flip', 'apic', found 'pic'"),
        ({"cache": 3}, r"cache must be a path or left out, found 3"),
        ({"spin": [1.0, 2.0]}, r"spin must be a list of 3: a number, a number, a number, found \[1\.0, 2\.0\]"),
        ({"spin": 1.0}, r"spin must be a list of 3"),
        ({"layers": [1, "two"]}, r"layers must be a list, each a whole number, found \[1, 'two'\]"),
        ({"damping": 2.0}, r"damping must be >= 0 and <= 1, found 2\.0"),
        ({"damping": 10**400}, r"damping must be a number"),
        ({"threads": 65}, r"threads above 64"),
    ],
)
def test_refusals_name_engine_option_and_what_is_allowed(engine, table, said):
    with pytest.raises(SceneError, match=r"^options of engine ballistic: .*" + said):
        build_options(engine, table)


def test_engine_without_options(engine):
    plain = dataclasses.replace(engine, options=None)
    assert build_options(plain, {}) is None
    with pytest.raises(SceneError, match="this engine has none"):
        build_options(plain, {"threads": 1})


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3)
VALUES = SCALARS | st.lists(SCALARS, max_size=4) | st.dictionaries(st.text(max_size=2), SCALARS, max_size=2)


@dataclass(frozen=True)
class _Descriptor:
    """What `build_options` needs of a descriptor; hypothesis does not mix with fixtures of one test."""

    name: str = "any"
    options: type = Options

    def option_names(self):
        return [field.name for field in dataclasses.fields(self.options)]


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from([field.name for field in dataclasses.fields(Options)]), VALUES, max_size=3))
def test_any_table_gives_options_or_a_scene_error(table):
    try:
        options = build_options(_Descriptor(), table)
    except SceneError as error:
        assert str(error).startswith("options of engine any: ")
    else:
        for field in dataclasses.fields(Options):
            if field.name not in table:
                assert getattr(options, field.name) == field.default
