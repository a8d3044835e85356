"""What is not declared is refused, and the refusal says which object and which engine could."""

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gasp_core.contract import (
    DEFAULT_BODY_CONTACT,
    BodyContact,
    BoxShape,
    Collider,
    ContactCondition,
    Determinism,
    Domain,
    DomainPolicy,
    Driven,
    Elastic,
    EngineCapabilities,
    EngineDescriptor,
    Field,
    Fluid,
    HalfSpace,
    Impulse,
    Pinned,
    PointCloud,
    PointProblem,
    Precision,
    Rigid,
    Sand,
    SphereShape,
    SteadyMotion,
    Trajectories,
    Wind,
    device_class,
    device_index,
)
from gasp_core.contract.capabilities import check_supported, needs, unmet
from gasp_core.errors import SceneError, UnsupportedSceneError

BALL = SphereShape(center=(0, 0, 0), radius=1)
FLOOR = HalfSpace(point=(0, 0, 0), normal=(0, 0, 1))
BOX = BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1))

EVERYTHING = EngineCapabilities(
    materials=frozenset({Elastic, Sand, Fluid, Rigid}),
    collider_shapes=frozenset({HalfSpace, BoxShape, SphereShape}),
    contact_conditions=frozenset(ContactCondition),
    body_contacts=frozenset(ContactCondition),
    pair_contacts=True,
    moving_colliders=True,
    restitution=True,
    rigid_parts=True,
    material_damping=True,
    trajectories=True,
    cohesion=True,
    drives=frozenset({Pinned, Driven, Impulse}),
    force_fields=frozenset({Wind}),
    output_fields=frozenset(Field),
    conserved=frozenset(),
    devices=("cpu", "cuda"),
    precisions=(Precision.FLOAT32, Precision.FLOAT64),
    determinism=Determinism.BITWISE,
    domain_policies=frozenset(DomainPolicy),
    carries_tracers=True,
    checkpoints=True,
    device_indices=True,
    material_columns=frozenset({"density"}),
)


def engine(name="black-box", **less):
    return EngineDescriptor(
        name=name,
        summary="",
        contract_version=(1, 0),
        capabilities=dataclasses.replace(EVERYTHING, **less),
        factory="a:b",
    )


SOLID = {"density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.2}
MATERIALS = (
    Elastic(**SOLID, stiffness_damping=1e-3),
    Sand(**SOLID, cohesion=0.01),
    Fluid(density=1.0, bulk_modulus=1.0),
    Rigid(density=1.0, restitution=0.5),
)


def problem(material_ids=(0, 1), body_ids=(0, 1), tracers=None, columns=None, **rest):
    count = len(material_ids)
    points = PointCloud(
        reference_positions=np.arange(3.0 * count).reshape(count, 3),
        initial_velocities=np.zeros((count, 3)),
        reference_volumes=np.ones(count),
        material_ids=np.array(material_ids),
        body_ids=np.array(body_ids),
        tracer_positions=tracers,
        material_columns=columns or {},
    )
    return PointProblem(points=points, materials=MATERIALS, **rest)


FULL = problem(
    material_ids=(0, 1, 3),
    body_ids=(0, 1, 2),
    rigid_parts={2: 0},
    tracers=np.zeros((1, 3)),
    columns={"density": np.array([2.0, math.nan, math.nan])},
    colliders=(Collider(shape=FLOOR), Collider(shape=BALL, contact=ContactCondition.SLIP, motion=SteadyMotion())),
    drives=(Pinned(region=BOX), Impulse(region=BOX)),
    force_fields=(Wind(velocity=(1, 0, 0), region=FLOOR),),
    domain=Domain(lower=(0, 0, 0), upper=(1, 1, 1), policy=DomainPolicy.CLAMP),
    body_contact=BodyContact(friction=0.7),
    pair_contacts={(0, 1): BodyContact(contact=ContactCondition.STICK)},
    trajectories=Trajectories(rows=[0], times=[0.0], displacements=np.zeros((1, 1, 3))),
)
ASKED = {
    "device": "cuda",
    "precision": Precision.FLOAT64,
    "fields": frozenset({Field.POSITIONS, Field.DEFORMATION_GRADIENTS}),
    "checkpoints": True,
    "body_names": ["bear", "bucket", "bear"],
}

LESS = {
    'does not model sand (object "bucket")': {"materials": frozenset({Elastic, Rigid})},
    "knows no sphere as a collider (collider 2)": {"collider_shapes": frozenset({HalfSpace})},
    'knows no contact "slip" (collider 2)': {"contact_conditions": frozenset({ContactCondition.SEPARATE})},
    "knows no colliders that move (collider 2)": {"moving_colliders": False},
    'has no restitution of rigid bodies (object "bear")': {"restitution": False},
    'damps no elastic (object "bear")': {"material_damping": False},
    'has no rigid parts of bodies that deform ("bear")': {"rigid_parts": False},
    "leads no points along trajectories": {"trajectories": False},
    'has no cohesion of sand (object "bucket")': {"cohesion": False},
    'knows no drive "impulse" (drive 2)': {"drives": frozenset({Pinned})},
    'knows no force field "wind" (force field 1)': {"force_fields": frozenset()},
    "knows no plane as a region (force field 1)": {"region_shapes": frozenset({BoxShape})},
    "has no density that varies from point to point": {"material_columns": frozenset()},
    'knows no contact "separate" of bodies': {"body_contacts": frozenset({ContactCondition.STICK})},
    'knows no contact "stick" of "bear" and "bucket"': {"body_contacts": frozenset({ContactCondition.SEPARATE})},
    'has one contact for all bodies, none of "bear" and "bucket" alone': {"pair_contacts": False},
    'knows no domain policy "clamp"': {"domain_policies": frozenset({DomainPolicy.EXPAND})},
    "carries no tracers": {"carries_tracers": False},
    "cannot report deformation_gradients": {"output_fields": frozenset({Field.VELOCITIES})},
    "writes no checkpoints": {"checkpoints": False},
    'does not run on device "cuda"': {"devices": ("cpu",)},
    "does not compute in float64": {"precisions": (Precision.FLOAT32,)},
}


def test_an_engine_that_can_everything_is_accepted():
    check_supported(FULL, engine(), **ASKED)


@pytest.mark.parametrize("refusal", LESS)
def test_each_capability_that_is_missing_is_refused(refusal):
    weak, strong = engine(**LESS[refusal]), engine("strong")
    with pytest.raises(UnsupportedSceneError) as caught:
        check_supported(FULL, weak, **ASKED, others=[weak, strong])
    assert str(caught.value).startswith(f"black-box {refusal}")
    assert "engines that do: strong" in str(caught.value)


def test_what_is_said_of_one_body_or_as_a_default_asks_nothing_of_an_engine():
    deaf = engine(body_contacts=frozenset(), pair_contacts=False)
    lone = problem(body_ids=(0, 0), body_contact=BodyContact(friction=0.7))
    check_supported(lone, deaf)
    check_supported(problem(), deaf)
    check_supported(problem(pair_contacts={(0, 1): DEFAULT_BODY_CONTACT}), engine(pair_contacts=False))


@pytest.mark.parametrize("pair", [(1, 0), (0, 0), (0, 2), (-1, 1)])
def test_a_contact_of_no_pair_is_refused(pair):
    with pytest.raises(SceneError, match=re.escape(f"pair_contacts: ({pair[0]}, {pair[1]}) must be two of the 2 bod")):
        problem(pair_contacts={pair: BodyContact()})


def test_every_field_of_the_capabilities_that_can_refuse_is_tried_here():
    described = {"conserved", "determinism", "temporal_order", "iterates", "unconditionally_stable", "damping"}
    # No scene asks that bodies meet in whatever way; users are told where they do not.
    described |= {"bodies_meet"}
    # Steps that are too many are refused by themselves: tests/simulation/test_stiff_matter.py.
    described |= {"stable_step"}
    # No scene asks for a view, and an index is part of a device: below.
    described |= {"views", "device_indices"}
    tried = {name for less in LESS.values() for name in less}
    assert tried == {field.name for field in dataclasses.fields(EngineCapabilities)} - described


def test_the_message_of_the_design():
    flex = engine("mujoco-flex", materials=frozenset({Elastic}))
    others = [engine("warp-mpm"), flex, engine("taichi-mpm"), engine("other", materials=frozenset())]
    with pytest.raises(UnsupportedSceneError) as caught:
        check_supported(problem(), flex, body_names=["bear", "bucket"], others=others)
    assert str(caught.value) == (
        'mujoco-flex does not model sand (object "bucket"); engines that do: taichi-mpm, warp-mpm'
    )


def test_a_material_with_a_name_is_called_by_it():
    named = tuple(dataclasses.replace(material, name=f"fine {material.kind}") for material in MATERIALS)
    weak, strong = engine(materials=frozenset({Elastic})), engine("strong")
    with pytest.raises(UnsupportedSceneError) as caught:
        check_supported(
            dataclasses.replace(problem(), materials=named), weak, body_names=["bear", "bucket"], others=[strong]
        )
    assert str(caught.value) == (
        'black-box does not model sand, the model of "fine sand" (object "bucket"); engines that do: strong'
    )


def test_what_only_the_asked_device_lacks_offers_the_engines_own():
    with pytest.raises(UnsupportedSceneError, match=r'does not run on device "cuda"; choose device cpu$'):
        check_supported(problem(), engine(devices=("cpu",)), device="cuda")
    other = engine("other", devices=("cuda",))
    with pytest.raises(UnsupportedSceneError, match=r"; choose device cpu; engines that do: other$"):
        check_supported(problem(), engine(devices=("cpu",)), device="cuda", others=[other])
    with pytest.raises(UnsupportedSceneError, match=r"; choose precision float32$"):
        check_supported(problem(), engine(precisions=(Precision.FLOAT32,)), precision=Precision.FLOAT64)


def test_a_material_that_no_point_is_made_of_is_not_asked_for():
    check_supported(problem((0, 0)), engine(materials=frozenset({Elastic})))


def test_bodies_without_names_and_many_bodies():
    weak = engine(materials=frozenset({Elastic}))
    with pytest.raises(UnsupportedSceneError, match=r"does not model sand; no other"):
        check_supported(problem(), weak)
    many = problem((1,) * 5, tuple(range(5)))
    with pytest.raises(UnsupportedSceneError, match=r'\(object "a", "b", "c" and 2 more\)'):
        check_supported(many, weak, body_names=list("abcde"))


def test_all_that_is_missing_is_said_in_one_line():
    weak = engine(materials=frozenset({Elastic}), devices=("cpu",))
    half = engine("half", devices=("cpu",))
    with pytest.raises(UnsupportedSceneError) as caught:
        check_supported(problem(), weak, device="cuda", others=[half])
    # "half" models sand, but not on the device that was asked for: naming it would only lead to the next refusal.
    assert str(caught.value) == (
        'black-box does not model sand and does not run on device "cuda"; no other installed engine does'
    )


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sets(st.sampled_from(sorted(LESS))))
def test_exactly_the_missing_is_unmet(missing):
    less = {}
    for refusal in missing:
        for name, value in LESS[refusal].items():
            less[name] = less.get(name, value) & value if isinstance(value, frozenset) else value
    told = unmet(needs(FULL, **ASKED), engine(**less).capabilities)
    assert len(told) == len(missing)
    assert all(any(need.refusal.startswith(refusal) for refusal in missing) for need in told)


def test_positions_need_no_declaration():
    check_supported(problem(), engine(output_fields=frozenset()), fields=frozenset({Field.POSITIONS}))


def test_a_drive_that_never_ends_is_no_trouble():
    check_supported(problem(drives=(Driven(region=BALL, end=math.inf),)), engine())


def test_one_of_several_devices_of_a_class_is_named_by_its_index():
    many, one = engine("many"), engine("one", device_indices=False)
    check_supported(problem(), many, device="cuda:1")
    for descriptor, device in ((one, "cuda:1"), (many, "cuda:"), (many, "cuda:-1"), (many, "cuda:x"), (many, "tpu:0")):
        with pytest.raises(UnsupportedSceneError, match=f'does not run on device "{device}"'):
            check_supported(problem(), descriptor, device=device)
    assert (device_class("cuda:1"), device_index("cuda:1")) == ("cuda", 1)
    assert (device_class("cuda"), device_index("cuda")) == ("cuda", None)


def test_a_column_stands_for_the_materials_own_number_where_it_is_one():
    some = problem((0, 1, 2), (0, 0, 0), columns={"density": [math.nan, 3.0, 4.0]})
    np.testing.assert_array_equal(some.material_values("density"), [1.0, 3.0, 4.0])
    np.testing.assert_array_equal(some.masses, [1.0, 3.0, 4.0])
    np.testing.assert_array_equal(problem((0, 2)).masses, [1.0, 1.0])


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"density": [1.0]}, r"density must have shape \(2,\), found \(1,\)"),
        ({"flavour": [1.0, 1.0]}, "elastic has no flavour"),
        ({"density": [1.0, -1.0]}, "density of point 1: .*density must be > 0"),
        ({"poissons_ratio": [0.7, 0.2]}, "poissons_ratio of point 0"),
    ],
)
def test_a_column_of_what_no_material_could_have_is_refused(columns, says):
    with pytest.raises(SceneError, match=says):
        problem(columns=columns)
