"""What was written against the names of 0.1 works for one more minor version, and is told where they are now."""

from __future__ import annotations

import importlib
import pkgutil
import warnings

import numpy as np
import pytest

import gasp_core.engine
from gasp_core.contract import EngineAccuracy, Impulse, PointProblem, SphereShape

OLD = [f"gasp_core.engine.{found.name}" for found in pkgutil.iter_modules(gasp_core.engine.__path__)]

NAMES = {
    "gasp_core.engine.contract": "CONTRACT_VERSION EngineAccuracy EngineCapabilities EngineDescriptor PointProblem",
    "gasp_core.engine.materials": "Elastic MATERIALS",
    "gasp_core.engine.forcing": "Collider Wind",
    "gasp_core.engine.shapes": "BoxShape HalfSpace SphereShape",
    "gasp_core.engine.checks": "finite finite_vector frozen_array",
    "gasp_core.engine.capabilities": "check_supported",
    "gasp_core.engine.options": "build_options",
    "gasp_core.engine.stability": "MotionLimits substep_size event_times",
    "gasp_core.engine.lattice": "grid_node",
    "gasp_core.engine.threads": "ThreadOptions processors",
    "gasp_core.engine.mpm": "GRADIENT_SHARE averaged_lame",
    "gasp_core.engine.hookspecs": "hookimpl Command RendererDescriptor",
    "gasp_core.engine.registry": "discover Registry",
    "gasp_core.engine.detector": "Watch inspect watch_over",
    "gasp_core.runs": "Run carry_out",
}


def test_every_old_module_is_tried_here():
    assert {*OLD, "gasp_core.runs"} == {*NAMES, "gasp_core.engine.stepped"}


@pytest.mark.parametrize("module", sorted(NAMES))
def test_an_old_name_is_the_new_thing_and_says_where_it_is(module):
    old = importlib.import_module(module)
    for name in NAMES[module].split():
        with pytest.warns(
            DeprecationWarning, match=rf"{module}\.{name} is gasp_core\.[\w.]+\.{name} now.*0\.3"
        ) as told:
            value = getattr(old, name)
        new = str(told[0].message).split(" is ")[1].split(" now")[0].rsplit(".", 1)[0]
        assert getattr(importlib.import_module(new), name) is value


def test_what_never_was_is_no_name_of_either():
    with pytest.raises(AttributeError, match=r"nor has 'gasp_core\.contract', its new name"):
        _ = importlib.import_module("gasp_core.engine.contract").Nonsense


def test_a_session_written_with_the_old_extension_points_still_steps():
    from gasp_core.engine.stepped import SteppedSession, kick

    with pytest.warns(DeprecationWarning, match="step_toward for _approach"):

        class Old(SteppedSession):
            def _approach(self, landing, end):
                self._living()["steps"] += 1
                self._took(1, landing - self.time, landing)

            def _strike(self, impulse):
                assert kick(impulse, np.zeros((1, 3)), np.ones(1)) is not None
                self._living()["blows"] += 1

            def _look(self, step):
                self._living()["looks"] += 1

            def _remarks(self):
                return ["old"]

            def _release(self, held):
                held["released"] = True

            def read(self, fields):
                raise AssertionError

            def checkpoint(self):
                raise AssertionError

    from gasp_core.contract import Elastic, PointCloud

    one = PointCloud(
        reference_positions=np.zeros((1, 3)),
        initial_velocities=np.zeros((1, 3)),
        reference_volumes=np.ones(1),
        material_ids=np.zeros(1),
        body_ids=np.zeros(1),
    )
    problem = PointProblem(
        points=one,
        materials=(Elastic(density=1, youngs_modulus=1, poissons_ratio=0.3),),
        drives=(Impulse(region=SphereShape(center=(0, 0, 0), radius=1), impulse=(1, 0, 0), start=0.0),),
    )
    counts = {"steps": 0, "blows": 0, "looks": 0}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        session = Old(problem, counts, engine="old", accuracy=EngineAccuracy())
        report = session.advance_to(0.5)
        session.close()
    assert (report.substep_count, report.warnings) == (1, ("old",))
    assert counts == {"steps": 1, "blows": 1, "looks": 2, "released": True}
