"""What an engine in this process gets wrong is said of that engine, with what it was doing."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from gasp_core.contract import Elastic, Field, PointCloud, PointProblem, PointState, Status, StepReport
from gasp_core.engines.held_session import held
from gasp_core.errors import EngineCrashedError, EngineDivergedError, SceneError

COUNT = 4
CLOUD = PointCloud(
    reference_positions=np.eye(4, 3),
    initial_velocities=np.zeros((COUNT, 3)),
    reference_volumes=np.ones(COUNT),
    material_ids=np.zeros(COUNT),
    body_ids=np.zeros(COUNT),
)
PROBLEM = PointProblem(
    points=CLOUD, materials=(Elastic(density=1000.0, youngs_modulus=1e5, poissons_ratio=0.3),), gravity=(0, 0, 0)
)
WANTED = frozenset({Field.POSITIONS, Field.VELOCITIES})


class Right:
    """What the contract asks for; a test replaces a part of it."""

    time = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def close(self):
        pass

    def advance_to(self, time):
        self.time = time
        return StepReport(status=Status.OK, substep_count=1, smallest_substep=time, largest_substep=time)

    def read(self, fields):
        return PointState(time=self.time, positions=np.eye(4, 3), velocities=np.zeros((COUNT, 3), np.float32))

    def checkpoint(self):
        return {"time": np.array(self.time), "steps": 3}


def opened(**parts):
    session = type("Wrong", (Right,), {name: staticmethod(part) for name, part in parts.items()})()
    return held(lambda: session, "mine", PROBLEM)


def raising(error):
    def part(*_):
        raise error

    return part


def state(**changes):
    return lambda fields: dataclasses.replace(Right().read(fields), **changes)


def test_what_is_right_goes_through():
    with opened() as session:
        assert session.advance_to(0.5).status is Status.OK
        assert session.time == 0.5
        np.testing.assert_array_equal(session.read(WANTED).positions, np.eye(4, 3))
        assert session.checkpoint()["steps"] == 3


def test_single_precision_and_another_order_are_converted_and_what_is_right_is_not_copied():
    single, sideways = np.eye(4, 3, dtype=np.float32), np.asfortranarray(np.arange(12.0).reshape(4, 3))
    with opened(read=state(positions=single, velocities=sideways)) as session:
        shown = session.read(WANTED)
    for array, given in ((shown.positions, single), (shown.velocities, sideways)):
        assert array.dtype == np.float64 and array.flags.c_contiguous and not array.flags.writeable
        np.testing.assert_array_equal(array, given)
    right = np.eye(4, 3)
    with opened(read=state(positions=right, velocities=right)) as session:
        assert session.read(WANTED).positions is right


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        (
            {"advance_to": raising(ValueError("shapes (3,) (4,)"))},
            "mine failed while advancing to 0.5 s: ValueError: sh",
        ),
        ({"advance_to": raising(SystemExit(0))}, "mine tries to exit the program (status 0), while advancing to 0.5 s"),
        ({"advance_to": lambda time: None}, "mine reports None, which is no StepReport"),
        ({"read": raising(KeyError("x"))}, "mine failed while reading positions, velocities: KeyError"),
        ({"read": lambda fields: 3}, "mine gives 3, which is no PointState"),
        ({"read": state(positions=np.zeros((3, 3)))}, "positions of shape (3, 3) and type float64, expected (4, 3)"),
        ({"read": state(velocities=np.zeros((1, 3)))}, "velocities of shape (1, 3)"),
        ({"read": state(velocities=None)}, "mine gives None as velocities"),
        ({"read": state(positions=np.zeros((4, 3), np.float16))}, "type float16"),
        ({"read": state(positions=[[0, 0, 0]] * 4)}, "mine failed while reading positions, velocities: "),
        ({"read": state(time=7.0)}, "a state of 7.0 s, where the session is at 0.0 s"),
        ({"checkpoint": lambda: None}, "mine gives None, which is no mapping"),
        ({"checkpoint": lambda: {"grid": object()}}, "as 'grid', which is no array of numbers"),
    ],
)
def test_what_is_wrong_is_told(parts, says):
    session = opened(**parts)
    with pytest.raises(EngineCrashedError) as caught:
        if "advance_to" in parts:
            session.advance_to(0.5)
        elif "read" in parts:
            session.read(WANTED)
        else:
            session.checkpoint()
    assert says in str(caught.value)
    assert "fault of the engine" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("error", [SceneError("no"), EngineDivergedError("far", None), KeyboardInterrupt()])
def test_what_an_engine_may_say_stays_as_it_is(error):
    with pytest.raises(type(error)) as caught:
        opened(advance_to=raising(error)).advance_to(0.5)
    assert caught.value is error


def test_an_engine_that_goes_elsewhere_takes_nobody_along(tmp_path):
    def opening():
        os.chdir(tmp_path)
        return Right()

    before = Path.cwd()
    held(opening, "mine", PROBLEM)
    assert Path.cwd() == before


@pytest.mark.parametrize("error", [RuntimeError("CUDA error"), SystemExit(1)])
def test_an_engine_that_cannot_be_opened_is_named(error):
    with pytest.raises(EngineCrashedError, match=r"^mine "):
        held(raising(error), "mine", PROBLEM)
