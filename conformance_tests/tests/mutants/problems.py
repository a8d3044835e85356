"""What they make of the problem: something in it is ignored, or taken for something else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from gasp_core.contract import (
    BodyContact,
    BoxShape,
    Collider,
    ContactCondition,
    DomainPolicy,
    Driven,
    Elastic,
    Fluid,
    FrictionCone,
    HalfSpace,
    Impulse,
    Material,
    NeoHookean,
    Pinned,
    PointProblem,
    Sand,
    Side,
    SignedDistanceField,
    SphereShape,
    SteadyMotion,
    StepReport,
    Wind,
)
from mutants.base import Mutant, Session, mutant


@mutant(
    "gravity-too-strong",
    {"free-fall": "largest error", "V1[sand]": "largest error", "V11[6 cells]": "gravity of a flight error"},
    slow=["V11[6 cells]"],
)
class GravityTooStrong(Mutant):
    """Gravity is 1 % off."""

    def problem(self, problem: PointProblem) -> PointProblem:
        x, y, z = problem.gravity
        return replace(problem, gravity=(1.01 * x, 1.01 * y, 1.01 * z))


@mutant("axes-swapped", {"free-fall": "largest error"})
class AxesSwapped(Mutant):
    """Its solver has y up, and gravity was not turned."""

    def problem(self, problem: PointProblem) -> PointProblem:
        x, y, z = problem.gravity
        return replace(problem, gravity=(x, z, y))


@mutant(
    "momentum-leaks",
    {
        "drift": "largest error",
        "V2": "momentum error",
        "conserved:linear_momentum": "centre off a straight line",
        "momentum": "change / sum",
    },
    slow=["momentum"],
)
class MomentumLeaks(Mutant):
    """A thousandth of all momentum is gone after a second."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, force_fields=(*problem.force_fields, Wind(drag=1e-3)))


def with_materials(problem: PointProblem, change: Callable[[Any], Material]) -> PointProblem:
    return replace(problem, materials=tuple(change(one) for one in problem.materials))


def elastic(material: Any, kind: type[Any]) -> Material:
    """The elastic solid of the same stiffness, in place of a material of that kind."""
    if not isinstance(material, kind):
        return material
    return Elastic(
        density=material.density, youngs_modulus=material.youngs_modulus, poissons_ratio=material.poissons_ratio
    )


@mutant("density-ignored", {"material:elastic[shear]": "frequency error", "material:elastic[bulk]": "frequency error"})
class DensityIgnored(Mutant):
    """All matter is as heavy as water."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: replace(one, density=1000.0))


@mutant(
    "volume-ignored",
    {"coincident-points": "distance from one point each", "conserved:mass": "centre off a straight line"},
)
class VolumeIgnored(Mutant):
    """Every point stands for as much matter as every other."""

    def problem(self, problem: PointProblem) -> PointProblem:
        volumes = problem.points.reference_volumes
        return replace(
            problem, points=replace(problem.points, reference_volumes=np.full_like(volumes, np.median(volumes)))
        )


@mutant(
    "modulus-ignored",
    {
        "material:elastic[shear]": "plate in shear: frequency error",
        "material:elastic[large strain]": "distance from its own law",
        "V10[32 cells]": "contact time error",
        "stiffness": "error",
    },
    slow=["stiffness"],
)
class ModulusIgnored(Mutant):
    """Young's modulus is 10 kPa, whatever is asked for."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(
            problem, lambda one: replace(one, youngs_modulus=1e4) if isinstance(one, Elastic) else one
        )


@mutant(
    "modulus-a-little-off",
    {
        "material:elastic[stretch]": "bar along itself: frequency error",
        "V3": "frequency error",
        "V4[24 cells]": "frequency error",
    },
)
class ModulusALittleOff(Mutant):
    """Elastic matter is 10 % too stiff."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(
            problem,
            lambda one: replace(one, youngs_modulus=1.1 * one.youngs_modulus) if isinstance(one, Elastic) else one,
        )


@mutant(
    "poissons-ratio-ignored",
    {"material:elastic[bulk]": "frequency error", "V5[slip walls]": "peak of the head error"},
    slow=["V5[slip walls]"],
)
class PoissonsRatioIgnored(Mutant):
    """Poisson's ratio is 0, whatever is asked for."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(
            problem, lambda one: replace(one, poissons_ratio=0.0) if isinstance(one, Elastic) else one
        )


@mutant("locks", {"near-incompressible": "mean drop"}, slow=["near-incompressible"])
class Locks(Mutant):
    """Cells that keep their volume lock: a fibre that bending stretches is as stiff as if its sides were held."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, self._locked)

    def _locked(self, material: Material) -> Material:
        if not isinstance(material, Elastic):
            return material
        return replace(material, youngs_modulus=material.lame_lambda + 2 * material.shear_modulus)


@mutant(
    "first-material-for-all",
    {"density-ratio": "momentum error", "material:elastic[stretch]": "bar along itself: frequency error"},
)
class FirstMaterialForAll(Mutant):
    """All bodies are made of the first material."""

    def problem(self, problem: PointProblem) -> PointProblem:
        ids = np.zeros_like(problem.points.material_ids)
        return replace(problem, points=replace(problem.points, material_ids=ids))


@mutant(
    "sand-is-rubber",
    {"material:sand[no tension]": "way not gone where nothing holds", "material:sand[friction]": "way / frictionless"},
)
class SandIsRubber(Mutant):
    """Sand never yields."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: elastic(one, Sand))


@mutant(
    "neo-hookean-is-corotated",
    {
        "agreement[neo-hookean]": "largest distance / size",
        "material:neo-hookean[large strain]": "distance from its own law",
    },
    slow=["agreement[neo-hookean]"],
)
class NeoHookeanIsCorotated(Mutant):
    """One elastic law serves for all."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: elastic(one, NeoHookean))


@mutant(
    "fluid-too-soft",
    {"material:fluid[compression]": "error", "V13[8 cells]": "mean sinking error"},
    slow=["V13[8 cells]"],
)
class FluidTooSoft(Mutant):
    """Fluids have half their bulk modulus."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(
            problem, lambda one: replace(one, bulk_modulus=one.bulk_modulus / 2) if isinstance(one, Fluid) else one
        )


@mutant("viscosity-ignored", {"material:fluid[shear]": "rate of decay error"})
class ViscosityIgnored(Mutant):
    """Honey flows like water."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(problem, lambda one: replace(one, viscosity=0.0) if isinstance(one, Fluid) else one)


def _with_colliders(problem: PointProblem, change: Callable[[Collider], Collider]) -> PointProblem:
    return replace(problem, colliders=tuple(change(one) for one in problem.colliders))


def _with_contacts(problem: PointProblem, asked: ContactCondition, done: ContactCondition) -> PointProblem:
    return _with_colliders(problem, lambda one: replace(one, contact=done) if one.contact is asked else one)


@mutant("friction-ignored", {"walls:separate": "way - Coulomb's"})
class FrictionIgnored(Mutant):
    """Every floor is ice."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, friction=0.0))


@mutant("stick-slips", {"walls:stick": "way on a slope / free"})
class StickSlips(Mutant):
    """What should stick only slips."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_contacts(problem, ContactCondition.STICK, ContactCondition.SLIP)


@mutant("slip-lets-go", {"walls:slip": "way off it / free"})
class SlipLetsGo(Mutant):
    """What should slip along a wall can leave it."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_contacts(problem, ContactCondition.SLIP, ContactCondition.SEPARATE)


def _with_body_contact(problem: PointProblem, contact: BodyContact) -> PointProblem:
    return replace(problem, body_contact=contact, pair_contacts={})


@mutant(
    "welded-bodies",
    {
        "bodies:separate[slide][0.5]": "deceleration / mu g - 1",
        "bodies:separate[part]": "way / free - 1",
        "bodies:slip": "slip along: way",
        "material:rigid[slide]": "deceleration / mu g - 1",
    },
    slow=["bodies:separate[slide][0.5]", "material:rigid[slide]"],
)
class WeldedBodies(Mutant):
    """Bodies that touch are one, as on a grid with one velocity for all."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_body_contact(problem, BodyContact(contact=ContactCondition.STICK))


@mutant("icy-bodies", {"bodies:separate[slide][0.3]": "deceleration / mu g - 1"}, slow=["bodies:separate[slide][0.3]"])
class IcyBodies(Mutant):
    """Bodies rub at nothing."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_body_contact(problem, BodyContact())


@mutant("bodies-always-part", {"bodies:slip": "pulled off: apart", "bodies:stick": "pulled along .*: apart"})
class BodiesAlwaysPart(Mutant):
    """What should hold bodies together lets them go."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_body_contact(problem, BodyContact(friction=problem.body_contact.friction))


@mutant("one-contact-for-all", {"pair-contacts": "deceleration / mu g"}, slow=["pair-contacts"])
class OneContactForAll(Mutant):
    """What a pair has of its own is not heard."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, pair_contacts={})


@mutant("fat-bodies", {"bodies:separate[part]": "way / free - 1"})
class FatBodies(Mutant):
    """Bodies reach farther than their matter: they touch what they only pass."""

    def problem(self, problem: PointProblem) -> PointProblem:
        points = replace(problem.points, reference_volumes=27 * problem.points.reference_volumes)
        lighter = with_materials(problem, lambda one: replace(one, density=one.density / 27))
        return replace(lighter, points=points)


@mutant("colliders-stand", {"moving-colliders": "way - closed form"})
class CollidersStand(Mutant):
    """Nothing that is prescribed moves a collider."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, motion=None))


def _ghostly(collider: Collider) -> Collider:
    """The same collider at the places of its motion, and without its speed."""
    motion = collider.motion
    if not isinstance(motion, SteadyMotion):
        return collider
    return replace(collider, motion=replace(motion, angular_velocity=(0.0, 0.0, 0.0)))


@mutant("tables-do-not-turn", {"moving-colliders": "angle / its own - 1"})
class TablesDoNotTurn(Mutant):
    """Colliders are moved and not turned."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, _ghostly)


@mutant(
    "wrong-side",
    {
        "collider:plane[inside]": "deepest point",
        "collider:box[inside]": "stopped before it",
        "collider:sphere[inside]": "deepest point",
    },
)
class WrongSide(Mutant):
    """A container is taken for an obstacle."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, side=Side.OUTSIDE))


@mutant(
    "balls-are-boxes", {"collider:sphere[outside]": "stopped before it", "collider:sphere[inside]": "deepest point"}
)
class BallsAreBoxes(Mutant):
    """A ball as a collider is the box around it."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, self._boxed)

    def _boxed(self, collider: Collider) -> Collider:
        ball = collider.shape
        if not isinstance(ball, SphereShape):
            return collider
        return replace(collider, shape=BoxShape(center=ball.center, half_extents=(ball.radius,) * 3))


@mutant(
    "planes-through-the-origin",
    {"collider:plane[outside]": "deepest point", "collider:plane[inside]": "stopped before it"},
)
class PlanesThroughTheOrigin(Mutant):
    """A plane has a normal, and its point is ignored."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, self._shifted)

    def _shifted(self, collider: Collider) -> Collider:
        plane = collider.shape
        if not isinstance(plane, HalfSpace):
            return collider
        return replace(collider, shape=replace(plane, point=(0.0, 0.0, 0.0)))


@mutant("half-extents-halved", {"collider:box[outside]": "deepest point", "collider:box[inside]": "stopped before it"})
class HalfExtentsHalved(Mutant):
    """A box's half extents are taken for its whole ones."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, self._halved)

    def _halved(self, collider: Collider) -> Collider:
        box = collider.shape
        if not isinstance(box, BoxShape):
            return collider
        x, y, z = box.half_extents
        return replace(collider, shape=replace(box, half_extents=(x / 2, y / 2, z / 2)))


@mutant(
    "shifted-fields",
    {
        "collider:signed distance field[outside]": "stopped before it",
        "collider:signed distance field[inside]": "deepest point",
    },
)
class ShiftedFields(Mutant):
    """A field is four nodes away from where it should be."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, self._shifted)

    def _shifted(self, collider: Collider) -> Collider:
        field = collider.shape
        if not isinstance(field, SignedDistanceField):
            return collider
        x, y, z = (place + 4 * field.spacing for place in field.origin)
        return replace(collider, shape=replace(field, origin=(x, y, z)))


@mutant("smooth-fields", {"collider:signed distance field[slope]": "way - Coulomb's"})
class SmoothFields(Mutant):
    """A field has no friction."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, self._smoothed)

    def _smoothed(self, collider: Collider) -> Collider:
        return replace(collider, friction=0.0) if isinstance(collider.shape, SignedDistanceField) else collider


@mutant("impulse-twice", {"drive:impulse": "error of the centre after"})
class ImpulseTwice(Mutant):
    """Every impulse is given twice."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(
            problem, drives=tuple(one for one in problem.drives for _ in range(1 + isinstance(one, Impulse)))
        )


@mutant(
    "pins-ignored",
    {
        "drive:pinned": "error in its time",
        "V4[24 cells]": "frequency error is nan",
        "V6[16 cells]": "error is nan",
        "V7[K=10]": "unrest / length",
    },
    slow=["V6[16 cells]", "V7[K=10]"],
)
class PinsIgnored(Mutant):
    """Nothing is ever held."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, drives=tuple(one for one in problem.drives if not isinstance(one, Pinned)))


@mutant("drives-never-end", {"drive:pinned": "error after its time", "drive:driven": "error after its time"})
class DrivesNeverEnd(Mutant):
    """What is held or moved is so for ever."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, drives=tuple(replace(one, end=np.inf) for one in problem.drives))


@mutant(
    "first-collider-alone", {"collider:plane[outside]": "deepest point", "collider:sphere[outside]": "deepest point"}
)
class FirstColliderAlone(Mutant):
    """Of several colliders it knows the first."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, colliders=problem.colliders[:1])


@mutant("last-collider-alone", {"collider:plane[outside]": "deepest point", "collider:box[inside]": "deepest point"})
class LastColliderAlone(Mutant):
    """Of several colliders it knows the last."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, colliders=problem.colliders[-1:])


@mutant(
    "first-friction-for-all",
    {"walls:separate": "no friction: way - free", "collider:signed distance field[slope]": "way - Coulomb's"},
)
class FirstFrictionForAll(Mutant):
    """Of several colliders all have the friction of the first."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: _rubbing_as(one, problem.colliders[0]))


def _rubbing_as(collider: Collider, other: Collider) -> Collider:
    return replace(collider, friction=other.friction) if collider.contact is ContactCondition.SEPARATE else collider


@mutant("last-friction-for-all", {"walls:separate": "separate, sliding: way - Coulomb's"})
class LastFrictionForAll(Mutant):
    """Of several colliders all have the friction of the last."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: _rubbing_as(one, problem.colliders[-1]))


@mutant(
    "first-contact-for-all",
    {"walls:stick": "stick: way on a slope", "walls:slip": "slip on a ceiling: way off it"},
)
class FirstContactForAll(Mutant):
    """Of several colliders all have the contact of the first."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, contact=problem.colliders[0].contact))


@mutant(
    "round-regions-are-boxes",
    {"drive:pinned": "error of matter elsewhere", "force-field:wind": "error of matter elsewhere"},
)
class RoundRegionsAreBoxes(Mutant):
    """A region that is a ball is taken for the box around it."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(
            problem,
            drives=tuple(map(_boxed, problem.drives)),
            force_fields=tuple(map(_boxed, problem.force_fields)),
        )


def _boxed(acting: Any) -> Any:
    ball = acting.region
    if not isinstance(ball, SphereShape):
        return acting
    return replace(acting, region=BoxShape(center=ball.center, half_extents=(ball.radius,) * 3))


@mutant("first-drive-wins", {"drive:driven": "error of what two drives hold"})
class FirstDriveWins(Mutant):
    """Of two drives that hold the same place the first in the list decides."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, drives=problem.drives[::-1])


@mutant("drives-do-not-turn", {"drive:driven": "error in its time"})
class DrivesDoNotTurn(Mutant):
    """What is driven moves, but does not turn."""

    def problem(self, problem: PointProblem) -> PointProblem:
        still = (0.0, 0.0, 0.0)
        return replace(
            problem,
            drives=tuple(
                replace(one, angular_velocity=still) if isinstance(one, Driven) else one for one in problem.drives
            ),
        )


@mutant("wind-ignored", {"force-field:wind": "error in its time"})
class WindIgnored(Mutant):
    """Wind is declared, accepted, and does nothing."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, force_fields=())


@mutant("wind-everywhere", {"force-field:wind": "error of matter elsewhere"})
class WindEverywhere(Mutant):
    """Wind blows outside its region, too."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, force_fields=tuple(replace(one, region=None) for one in problem.force_fields))


@mutant("expand-does-not", {"domain:expand": "error of free fall"})
class ExpandDoesNot(Mutant):
    """A domain that should grow with the matter holds it back."""

    def problem(self, problem: PointProblem) -> PointProblem:
        domain = problem.domain
        if domain is None or domain.policy is not DomainPolicy.EXPAND:
            return problem
        return replace(problem, domain=replace(domain, policy=DomainPolicy.CLAMP))


class Silent(Session):
    """Keeps its warnings to itself."""

    def advance_to(self, time: float) -> StepReport:
        return replace(self.inner.advance_to(time), warnings=())


@mutant(
    "keeps-warnings-to-itself",
    {
        "domain:clamp": "what the edge held back has to be told",
        "domain-edge": "what the edge held back is not reported",
    },
)
class KeepsWarningsToItself(Mutant):
    """What the domain's edge held back, and what was turned inside out, is not told."""

    session = Silent


@mutant("clamps-where-it-should-stop", {"domain:stop": "a point left the domain, and the run ended ok"})
class ClampsWhereItShouldStop(Mutant):
    """Points that leave the domain are put back and nobody is told."""

    session = Silent

    def problem(self, problem: PointProblem) -> PointProblem:
        domain = problem.domain
        if domain is None or domain.policy is not DomainPolicy.STOP:
            return problem
        return replace(problem, domain=replace(domain, policy=DomainPolicy.CLAMP))


class Sharing(Session):
    """Gives the impulses of its problem itself."""

    def advance_to(self, time: float) -> StepReport:
        due = [one for one in self.problem.drives if isinstance(one, Impulse) and self.time <= one.start < time]
        reports = []
        for one in due:
            reports.append(self.inner.advance_to(one.start))
            state = self.inner.checkpoint()
            struck = one.region.signed_distance(self.inner.read(frozenset()).positions) <= 0
            kick = np.asarray(one.impulse) / struck.sum() / self.problem.masses[:, None]
            self.change(velocities=state["velocities"] + struck[:, None] * kick)
        reports.append(self.inner.advance_to(time))
        taken = [one for one in reports if one.substep_count]
        return replace(
            reports[-1],
            substep_count=sum(one.substep_count for one in reports),
            smallest_substep=min((one.smallest_substep for one in taken), default=0.0),
            largest_substep=max((one.largest_substep for one in taken), default=0.0),
        )


@mutant("impulse-in-equal-shares", {"drive:impulse": "error of points of unequal mass"})
class ImpulseInEqualShares(Mutant):
    """An impulse is shared out by number, not by mass."""

    session = Sharing

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, drives=tuple(one for one in problem.drives if not isinstance(one, Impulse)))


@mutant("sand-modulus-ignored", {"material:sand[compression]": "period error"})
class SandModulusIgnored(Mutant):
    """Sand is as stiff as it likes."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return with_materials(
            problem, lambda one: replace(one, youngs_modulus=8 * one.youngs_modulus) if isinstance(one, Sand) else one
        )


def _with_sand(problem: PointProblem, **changes: Any) -> PointProblem:
    return with_materials(problem, lambda one: replace(one, **changes) if isinstance(one, Sand) else one)


@mutant("sand-as-in-compression", {"material:sand[friction]": "flow of a layer - way / frictionless"})
class SandAsInCompression(Mutant):
    """Whatever sand's angle was measured in, its cone is that of triaxial compression."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_sand(problem, cone=FrictionCone.TRIAXIAL_COMPRESSION)


@mutant("sand-always-dry", {"cohesion": "cohesion that holds"})
class SandAlwaysDry(Mutant):
    """Sand does not cohere."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_sand(problem, cohesion=0.0)


@mutant("nobody-is-led", {"trajectories": "distance at the moments"})
class NobodyIsLed(Mutant):
    """Led points move like any other."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return replace(problem, trajectories=None)


@mutant("led-in-straight-lines", {"trajectories": "distance between moments"})
class LedInStraightLines(Mutant):
    """Between moments led points go straight."""

    def problem(self, problem: PointProblem) -> PointProblem:
        led = problem.trajectories
        if led is None:
            return problem
        times = np.unique(np.concatenate([led.times, *(led.times[1:] - share * np.diff(led.times) for share in _FINE)]))
        moves = led.displacements.reshape(len(led.times), -1)
        straight = np.stack([np.interp(times, led.times, column) for column in moves.T], axis=1)
        moves = straight.reshape(len(times), len(led.rows), 3)
        return replace(problem, trajectories=replace(led, times=times, displacements=moves))


@mutant("led-without-what-hangs-on-them", {"trajectories": "difference from one that weighs"})
class LedWithoutWhatHangsOnThem(Mutant):
    """Led points take along what hangs on them by half of their way."""

    def problem(self, problem: PointProblem) -> PointProblem:
        led = problem.trajectories
        if led is None or problem.points.body_ids.any():
            return problem
        return replace(problem, trajectories=replace(led, displacements=led.displacements / 2))


_FINE = np.linspace(0.1, 0.9, 9)


@mutant("friction-a-little-off", {"V12": "way error"}, slow=["V12"])
class FrictionALittleOff(Mutant):
    """Friction is 5 % too strong."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, friction=1.05 * one.friction))


@mutant("friction-with-a-limit", {"V12": "creep"}, slow=["V12"])
class FrictionWithALimit(Mutant):
    """No friction is stronger than one on which the block just slides, ever so slowly."""

    def problem(self, problem: PointProblem) -> PointProblem:
        return _with_colliders(problem, lambda one: replace(one, friction=min(one.friction, 0.44)))
