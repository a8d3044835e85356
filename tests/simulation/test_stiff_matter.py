"""Matter that is too stiff for explicit steps: refused at once, with what to do."""

from __future__ import annotations

import dataclasses
import re

import flying_points
import numpy as np
import pytest
from installed_engines import ready

from gasp_core import (
    Collider,
    Elastic,
    EngineAccuracy,
    EngineChoice,
    Fluid,
    HalfSpace,
    Metal,
    NeoHookean,
    Pinned,
    Recording,
    Rigid,
    Scene,
    Snow,
    SphereShape,
    SplatObject,
    material_preset,
    simulate,
)
from gasp_core.contract import PointCloud, PointProblem
from gasp_core.discovery.registry import discover
from gasp_core.errors import EngineDivergedError, UnsupportedSceneError
from gasp_core.simulation.estimate import estimate_run
from gasp_core.simulation.stiff_matter import refuse_too_stiff
from gasp_core.stepping.time_step import rest_bound

FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
SHARE = EngineAccuracy().substep_fraction
STEEL = Elastic(density=7850, youngs_modulus=2e11, poissons_ratio=0.3)
SPACING = 0.01


def engine(name="explicit", **can):
    own = flying_points.descriptor()
    can.setdefault("materials", frozenset({Elastic, NeoHookean, Metal, Fluid, Snow}))
    can.setdefault("stable_step", rest_bound)
    return dataclasses.replace(own, name=name, capabilities=dataclasses.replace(own.capabilities, **can))


RIGID = engine("rigid-bodies", materials=frozenset({Rigid}), stable_step=None)
IMPLICIT = engine("implicit", materials=frozenset({Elastic}), stable_step=None, unconditionally_stable=True)

DAMPING = engine(
    "implicit-and-damped",
    materials=frozenset({Elastic}),
    stable_step=None,
    unconditionally_stable=True,
    material_damping=True,
)


def problem(*materials, height=0.0, **rest):
    """A cube of 0.4 m of each material, as high above the floor."""
    axis = (np.arange(8) + 0.5) * 0.05
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) + [0, 0, height]
    count = len(cube)
    points = PointCloud(
        reference_positions=np.concatenate([cube + [2.0 * row, 0, 0] for row in range(len(materials))]),
        initial_velocities=np.zeros((count * len(materials), 3)),
        reference_volumes=np.full(count * len(materials), 0.05**3),
        material_ids=np.repeat(np.arange(len(materials)), count),
        body_ids=np.repeat(np.arange(len(materials)), count),
    )
    return PointProblem(points=points, materials=materials, colliders=(FLOOR,), **rest)


def refusal(asked, *, explicit=None, others=(RIGID, IMPLICIT), names=("toy", "ball"), frame_step=0.04, **accuracy):
    accuracy.setdefault("spacing", SPACING)
    with pytest.raises(UnsupportedSceneError) as caught:
        refuse_too_stiff(
            asked,
            explicit or engine(),
            EngineAccuracy(**accuracy),
            frame_step=frame_step,
            duration=1.0,
            body_names=names,
            others=others,
        )
    said = str(caught.value)
    assert "\n" not in said
    return said


def accepted(asked, *, explicit=None, frame_step=0.04, **accuracy):
    accuracy.setdefault("spacing", SPACING)
    refuse_too_stiff(asked, explicit or engine(), EngineAccuracy(**accuracy), frame_step=frame_step, duration=1.0)


def test_it_says_how_many_substeps_whose_and_what_is_allowed():
    said = refusal(problem(material_preset("jelly"), STEEL))
    needed = 0.04 / (SHARE * rest_bound(STEEL, SPACING))
    assert f"explicit would need {int(np.ceil(needed)):,} substeps" in said
    assert "substep_limit under [accuracy] is 20,000" in said
    assert 'elastic of E = 2e11 Pa of object "ball"' in said
    assert '"toy"' not in said


def test_it_names_engines_that_take_it_for_rigid_by_what_they_declare():
    assert 'say model = "rigid" with rigid-bodies: it does not deform then; ' in refusal(problem(STEEL))
    assert "rigid" not in refusal(problem(STEEL), others=(IMPLICIT,))
    # It has to do the rest of the scene as well.
    held = problem(STEEL, drives=(Pinned(region=SphereShape(center=(0, 0, 0), radius=0.1)),))
    no_drives = dataclasses.replace(RIGID, capabilities=dataclasses.replace(RIGID.capabilities, drives=frozenset()))
    assert "rigid-bodies" not in refusal(held, others=(no_drives,))
    both = engine(materials=frozenset({Elastic, Rigid}))
    assert 'say model = "rigid" with explicit: ' in refusal(problem(STEEL), explicit=both)


def test_what_flows_is_not_told_to_be_rigid():
    for flowing in (
        Fluid(density=1000, bulk_modulus=2.2e11),
        Snow(density=400, youngs_modulus=1e11, poissons_ratio=0.2),
    ):
        said = refusal(problem(flowing))
        assert "rigid" not in said
        assert "take a coarser resolution, or raise substep_limit" in said


def test_it_says_the_softer_modulus_and_that_this_one_is_accepted():
    said = refusal(problem(STEEL))
    modulus, count = re.search(
        r"say youngs_modulus = (\S+), which .* needs ([\d,]+) substeps rather than", said
    ).groups()
    softer = dataclasses.replace(STEEL, youngs_modulus=float(modulus))
    # 3/2 (L/t)^2 rho g L / E of a cube: its points, in the middle of their parts, span 0.35 m, which is less than t.
    assert float(modulus) == pytest.approx(1.5 * 7850 * 9.81 * 0.35 / 1e-3, rel=0.1)
    assert "below 0.001 of its size under its own weight and needs" in said
    assert int(count.replace(",", "")) == int(np.ceil(0.04 / (SHARE * rest_bound(softer, SPACING))))
    accepted(problem(softer))


def test_where_it_is_stopped_counts_if_that_can_be_paid():
    said = refusal(problem(STEEL, height=0.01))
    # Up to two digits, and a point touches within a thousandth of the body's size.
    assert "under its own weight, and as it is stopped at 0.44 m/s, and needs" in said
    modulus = float(re.search(r"youngs_modulus = ([\d.e]+)", said)[1])
    assert modulus == pytest.approx(3 * 7850 * 2 * 9.81 * 0.01 / 1e-6, rel=0.1)
    high = refusal(problem(STEEL, height=2.0))
    # Real steel gives way by more than a thousandth there: that it does for a moment is said.
    assert re.search(r"under its own weight \(for a moment by up to [\d.]+ % as it is stopped at 6\.3 m/s\)", high)
    accepted(problem(dataclasses.replace(STEEL, youngs_modulus=modulus), height=0.01))


def test_other_matter_counts_in_what_softer_matter_would_cost():
    def cost(said):
        return int(re.search(r"needs ([\d,]+) substeps rather", said)[1].replace(",", ""))

    nearly = dataclasses.replace(STEEL, youngs_modulus=1e10)
    assert cost(refusal(problem(STEEL))) < 2_000
    assert cost(refusal(problem(STEEL, nearly))) == int(np.ceil(0.04 / (SHARE * rest_bound(nearly, SPACING))))
    # What is too stiff itself is to be changed as well.
    glass = material_preset("glass")
    said = refusal(problem(STEEL, glass))
    assert 'of object "toy" is that stiff, and so is object "ball". Either' in said
    assert cost(said) < 2_000


def test_engines_whose_steps_no_stiffness_shortens_are_named():
    assert "take implicit, whose steps no stiffness shortens" in refusal(problem(STEEL))
    metal = Metal(density=7850, youngs_modulus=2e11, poissons_ratio=0.3, yield_stress=2.5e8)
    assert 'say model = "elastic" with implicit, whose steps' in refusal(problem(metal))
    assert "stiffness shortens" not in refusal(problem(STEEL), others=(RIGID,))


def test_a_preset_is_changed_as_a_scene_file_has_it():
    said = refusal(problem(material_preset("steel")))
    assert '"steel" (metal, E = 2.1e11 Pa) of object "toy"' in said
    assert 'say material = { preset = "steel", model = "rigid" } with rigid-bodies' in said
    assert 'say material = { preset = "steel", youngs_modulus = ' in said
    assert 'say material = { preset = "steel", model = "elastic" } with implicit' in said
    named = dataclasses.replace(STEEL, name="hull")
    assert '"hull" (elastic, E = 2e11 Pa)' in refusal(problem(named))
    assert 'say model = "rigid" with' in refusal(problem(named))


def test_a_stiff_fluid_is_offered_a_lower_bulk_modulus():
    said = refusal(problem(material_preset("water", bulk_modulus=2.2e9)), spacing=0.001)
    modulus = float(re.search(r'say material = \{ preset = "water", bulk_modulus = (\S+) \}', said)[1])
    # (10 v)^2 rho, v from the height that it has.
    assert modulus == pytest.approx(100 * 998 * 2 * 9.81 * 0.35, rel=0.1)
    assert "keeps its density to 1 % and needs" in said


def test_what_is_within_the_limit_or_somebody_elses_business_is_let_pass():
    accepted(problem(material_preset("jelly")))
    accepted(problem(STEEL), substep_limit=100_000)
    accepted(problem(STEEL), frame_step=0.001)
    accepted(problem(STEEL), spacing=1.0)
    # A fixed step is refused by the engine, and an engine that says nothing of its steps knows itself.
    accepted(problem(STEEL), substep=1e-9)
    accepted(problem(STEEL), explicit=engine(stable_step=None))
    # Nothing there has a stiffness.
    accepted(problem(Rigid(density=1.0)))


def test_exactly_the_limit_is_accepted():
    needed = int(np.ceil(0.04 / (SHARE * rest_bound(STEEL, SPACING))))
    accepted(problem(STEEL), substep_limit=needed)
    assert f"need {needed:,} substeps" in refusal(problem(STEEL), substep_limit=needed - 1)


# --- through whole runs -----------------------------------------------------------------------------------------------


@pytest.fixture
def steel(cloud):
    item = SplatObject(
        name="toy", splat=cloud(60), material=material_preset("steel"), height=0.3, position=(0, 0, 0.05)
    )
    return Scene(
        duration=0.08,
        frame_rate=25,
        objects=(item,),
        colliders=(FLOOR,),
        engine=EngineChoice(name="reference-mpm"),
        accuracy=EngineAccuracy(resolution=24),
    )


@pytest.mark.parametrize("name", ["reference-mpm", pytest.param("taichi-mpm", marks=pytest.mark.thorough), "warp-mpm"])
def test_the_engine_would_have_said_the_same_number(name, steel, tmp_path):
    """Only later: with a frame whose every substep is counted by the engine itself."""
    ready(name)
    with pytest.raises(UnsupportedSceneError) as caught:
        simulate(steel, name, tmp_path / "run.gasp")
    told = re.search(rf"{name} would need ([\d,]+) substeps of (\S+) s", str(caught.value))
    assert not (tmp_path / "run.gasp").exists()
    blind = discover().descriptor(name)
    blind = dataclasses.replace(blind, capabilities=dataclasses.replace(blind.capabilities, stable_step=None))
    from gasp_core.engines.opening import open_engine

    with pytest.raises(EngineDivergedError) as stopped:
        simulate(steel, (blind, open_engine(discover().offer(name))), tmp_path / "run.gasp")
    assert f"needs {told[1]} substeps of {told[2]} s" in str(stopped.value)


def test_a_dry_run_is_refused_what_the_run_is(steel, tmp_path):
    ready("reference-mpm")
    with pytest.raises(UnsupportedSceneError) as dry:
        estimate_run(steel, tmp_path / "trial.gasp")
    with pytest.raises(UnsupportedSceneError) as whole:
        simulate(steel, out=tmp_path / "run.gasp")
    assert str(dry.value) == str(whole.value)
    assert 'object "toy"' in str(dry.value)


def test_a_run_of_one_frame_moves_nothing_and_is_let_pass(steel, tmp_path):
    ready("reference-mpm")
    assert simulate(steel, out=tmp_path / "run.gasp", frames=1).frame_count == 1
    # What is gone on with is the engine's to judge.
    with pytest.raises(EngineDivergedError):
        simulate(steel, out=tmp_path / "run.gasp", resume=True)
    assert Recording.open(tmp_path / "run.gasp").frame_count == 1


def test_steel_that_is_rigid_falls(steel, tmp_path):
    ready("mujoco-flex")
    (item,) = steel.objects
    rigid = dataclasses.replace(
        steel, objects=(dataclasses.replace(item, material=material_preset("steel", model="rigid")),)
    )
    run = simulate(rigid, "mujoco-flex", tmp_path / "run.gasp")
    assert run.status == "complete"
    assert run.points(2)[:, 2].mean() < run.points(0)[:, 2].mean()


def test_damping_that_takes_the_steps_is_named():
    damped = Elastic(density=1000, youngs_modulus=1e5, poissons_ratio=0.3, stiffness_damping=0.5)
    with pytest.raises(UnsupportedSceneError) as refusal:
        refuse_too_stiff(
            problem(damped),
            engine(material_damping=True),
            EngineAccuracy(spacing=SPACING, substep_limit=1000),
            frame_step=0.04,
            duration=1.0,
            body_names=["bear"],
            others=[dataclasses.replace(IMPLICIT, name="gentle"), DAMPING],
        )
    said = str(refusal.value)
    assert re.search(r'without the stiffness_damping of object "bear" it would be \d+\. Either say less of it', said)
    assert "mass_damping instead" in said
    assert "take implicit-and-damped, whose steps" in said
    assert "gentle" not in said
