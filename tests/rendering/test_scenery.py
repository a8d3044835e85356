from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gasp_core import BoxShape, Collider, HalfSpace, Side, SphereShape
from gasp_core.contract import SignedDistanceField, SteadyMotion
from gasp_core.render_input import RenderInput
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.contract import Picture
from gasp_core.rendering.framing import Motion
from gasp_core.rendering.scenery import LIGHT, draw_scenery, nearest_hits
from gasp_core.rendering.shadows import Lamp, ShadowedScenery

FLOOR = Collider(shape=HalfSpace(point=(0, 0, 0), normal=(0, 0, 1)))
BALL = Collider(shape=SphereShape(center=(0, 0, 1), radius=0.5))
BOX = Collider(shape=BoxShape(center=(0, 0, 1), half_extents=(0.5, 0.4, 0.3)))


TUBE = SignedDistanceField.sampled(SphereShape(center=(0, 0, 1), radius=0.5), (-0.3, -0.6, 0.3), (0.6, 0.6, 1.6), 0.06)
"""Of a ball, with a face where the box that it was looked for in ends."""


def camera(eye=(0, -4, 1), target=(0, 0, 1), width=64, height=48, **options):
    return look_at(eye, target, width=width, height=height, **options)


def drawn(*colliders, seen_from=None):
    return draw_scenery(colliders, seen_from or camera(), centre=np.array([0, 0, 1.0]), reach=2.0)


# Nanometres: a slope of 1e-308 ends where no number reaches.
coordinates = st.floats(-3, 3).map(lambda metres: round(metres, 9))
vectors = st.tuples(coordinates, coordinates, coordinates)


@given(
    eye=vectors, toward=vectors, shape=st.sampled_from([FLOOR.shape, BALL.shape, BOX.shape]), side=st.sampled_from(Side)
)
@settings(max_examples=300)
def test_a_ray_ends_on_the_surface_and_nowhere_before(eye, toward, shape, side):
    """Against the shapes' own signed distance: on it at the hit, and on the side of matter all the way."""
    if np.linalg.norm(toward) < 0.1:
        return
    collider = Collider(shape=shape, side=side)
    origin, ray = np.array(eye), np.array([toward])
    depth = nearest_hits([collider], origin, ray).depth[0]
    sign = 1 if side is Side.OUTSIDE else -1
    if np.isfinite(depth):
        # Rounding at coordinates of up to some hundred: grazing rays meet far away.
        assert abs(shape.signed_distance(origin + depth * ray)[0]) < 1e-12 * (1 + depth) * 10
    if sign * shape.signed_distance(origin[None])[0] > 1e-9:
        # From where matter may be, nothing solid is on the way to the hit (or for ever).
        steps = np.linspace(0, min(depth, 50.0), 200)[:, None]
        assert (sign * shape.signed_distance(origin + steps * ray) > -1e-6).all()


@given(eye=vectors, toward=vectors, side=st.sampled_from(Side))
@settings(max_examples=300)
def test_a_ray_ends_on_the_surface_of_a_field(eye, toward, side):
    """To a few thousandths of a spacing; on the way there is nothing that is deeper than a tenth of one."""
    if np.linalg.norm(toward) < 0.1:
        return
    origin, ray = np.array(eye), np.array([toward])
    depth = nearest_hits([Collider(shape=TUBE, side=side)], origin, ray).depth[0]
    sign = 1 if side is Side.OUTSIDE else -1
    if np.isfinite(depth):
        assert abs(TUBE.signed_distance(origin + depth * ray)[0]) < 5e-3 * TUBE.spacing
    if sign * TUBE.signed_distance(origin[None])[0] > 0:
        steps = np.linspace(0, min(depth, 50.0), 400)[:, None]
        assert (sign * TUBE.signed_distance(origin + steps * ray) > -0.1 * TUBE.spacing).all()


def test_a_field_is_seen_from_where_matter_may_be():
    """Into a container through its near wall; a ray beside it meets nothing."""
    rays = np.array([[0.0, 1, 0], [0.0, 1, 0.5]])
    outside = nearest_hits([Collider(shape=TUBE)], np.array([0.0, -4, 1]), rays).depth
    inside = nearest_hits([Collider(shape=TUBE, side=Side.INSIDE)], np.array([0.0, -4, 1]), rays).depth
    # The trilinear ball is off by h^2 / 8 R.
    assert outside == pytest.approx([3.5, np.inf], abs=2e-3)
    assert inside == pytest.approx([4.5, np.inf], abs=2e-3)


def test_the_nearest_of_several_is_met():
    hit = nearest_hits([FLOOR, BALL], np.array([0.0, 0, 4]), np.array([[0.0, 0, -1], [1.0, 0, -1]]))
    assert hit.depth == pytest.approx([2.5, 4.0])
    assert hit.collider.tolist() == [1, 0]


def test_what_stands_where_in_the_picture():
    picture = drawn(BALL)
    assert picture.depth[24, 32] == pytest.approx(3.5, rel=1e-3)
    assert picture.alpha[24, 32] == 1 and picture.alpha[0, 0] == 0
    assert np.isinf(picture.depth[0, 0])
    # The silhouette is 0.5 / sqrt(4^2 - 0.5^2) * focal in radius; half a pixel on either side.
    radius = 0.5 / np.sqrt(16 - 0.25) * camera().focal_x
    assert (picture.alpha.sum() / np.pi) ** 0.5 == pytest.approx(radius, abs=0.5)


def test_edges_are_smooth():
    alpha = drawn(BALL).alpha
    assert np.unique(alpha).tolist() == [0, 0.25, 0.5, 0.75, 1]


def test_a_container_is_seen_from_within_and_through_its_near_wall():
    container = Collider(shape=BOX.shape, side=Side.INSIDE)
    assert drawn(container).depth[24, 32] == pytest.approx(4.4, rel=1e-3)
    within = drawn(container, seen_from=camera(eye=(0, 0, 1), target=(0, 1, 1)))
    assert np.isfinite(within.depth).all() and (within.alpha == 1).all()
    assert within.depth[24, 32] == pytest.approx(0.4, rel=1e-3)


def test_from_inside_an_obstacle_and_from_below_a_floor_there_is_nothing():
    assert not drawn(BALL, seen_from=camera(eye=(0, 0, 1), target=(0, 1, 1))).alpha.any()
    assert not drawn(FLOOR, seen_from=camera(eye=(0, 0, -1), target=(0, 0, 1))).alpha.any()


def test_a_floor_fades_out_and_has_lines_a_round_length_apart():
    straight_down = look_at((0, 0, 30), (0, 0, 0), width=301, height=301, field_of_view=70)
    picture = draw_scenery([FLOOR], straight_down, centre=np.zeros(3), reach=2.0)
    assert picture.alpha[150, 150] == 1
    assert picture.alpha[0, 0] == 0
    assert np.isfinite(picture.depth).all()
    near = look_at((0.1, 0.1, 1), (0.1, 0.1, 0), width=400, height=400, field_of_view=90)
    row = draw_scenery([FLOOR], near, centre=np.zeros(3), reach=2.0).colour[330, :, 0]
    dark = np.flatnonzero(row < 0.95 * row.max())
    lines = dark[np.flatnonzero(np.diff(np.concatenate([[-9], dark])) > 1)]
    # reach / 4 = 0.5 m, the focal length is 200 px at depth 1.
    assert np.diff(lines) == pytest.approx([100] * (len(lines) - 1), abs=2) and len(lines) >= 3


def test_no_collider_is_a_transparent_picture():
    picture = drawn()
    assert not picture.alpha.any() and not picture.colour.any() and np.isinf(picture.depth).all()


def test_one_picture_before_another():
    def flat(value, alpha, depth):
        shape = (1, 1)
        return Picture(
            colour=np.full((1, 1, 3), value * alpha, np.float32),
            alpha=np.full(shape, alpha, np.float32),
            depth=np.full(shape, depth, np.float32),
        )

    both = flat(1.0, 0.25, 1.0).before(flat(0.5, 0.5, 2.0))
    assert both.alpha[0, 0] == pytest.approx(0.25 + 0.75 * 0.5)
    assert both.colour[0, 0, 0] == pytest.approx(0.25 + 0.75 * 0.25)
    assert both.depth[0, 0] == 1.0
    assert flat(1.0, 0.0, np.inf).before(flat(0.5, 0.5, 2.0)).depth[0, 0] == 2.0
    assert flat(1.0, 0.25, 1.0).over(np.array([0.0, 0.0, 1.0]))[0, 0] == pytest.approx([0.25, 0.25, 1.0])


class Disc:
    """A renderer that sees a ball of radius 0.2 about each mean, opaque."""

    def render(self, splats, camera, *, occluders=None):
        places, depths = camera.project(splats.means)
        y, x = np.mgrid[: camera.height, : camera.width] + 0.5
        alpha = np.zeros((camera.height, camera.width), np.float32)
        for place, depth in zip(places, depths):
            alpha[np.hypot(x - place[0], y - place[1]) < 0.2 * camera.focal_x / depth] = 1
        return Picture(colour=np.zeros((*alpha.shape, 3), np.float32), alpha=alpha, depth=alpha)


def test_a_shadow_falls_where_the_lamp_says():
    eye = look_at((0, 0, 6), (0, 0, 0), width=200, height=200, field_of_view=60, up=(0, 1, 0))
    motion = Motion(points=np.array([[-1.0, -1, 0], [1, 1, 2]]), frames=np.zeros(2, dtype=int))
    scenery = draw_scenery([FLOOR], eye, centre=motion.centre, reach=motion.reach)
    shadowed = ShadowedScenery.of(scenery, eye, Lamp.of([FLOOR], motion))
    mean = np.array([[0.1, -0.2, 1.0]])
    splats = RenderInput(means=mean, opacities=np.ones(1), harmonics=np.zeros((1, 1, 3)), covariances=np.zeros((1, 6)))
    dark = 1 - shadowed.under(splats, Disc()).colour[:, :, 0] / scenery.colour[:, :, 0]
    y, x = np.mgrid[:200, :200] + 0.5
    found = np.array([(dark * x).sum(), (dark * y).sum()]) / dark.sum()
    (expected,), _ = eye.project(mean - LIGHT / LIGHT[2] * mean[0, 2])
    # The lamp is 30 sizes away: parallel to 1/60 of a metre here, under a pixel of the map; so are the blur's edges.
    assert found == pytest.approx(expected, abs=1.0)
    assert dark.max() == pytest.approx(0.45, abs=0.01)
    # A ball's shadow covers pi r^2 / cos(slope) of a floor.
    area = dark.sum() / 0.45 * (6 / eye.focal_x) ** 2
    assert area == pytest.approx(np.pi * 0.04 / (LIGHT[2] / np.linalg.norm(LIGHT)), rel=0.05)
    assert np.array_equal(shadowed.under(splats, Disc()).alpha, scenery.alpha)


def test_what_is_buried_casts_no_shadow_and_what_is_at_the_edge_of_the_motion_casts_all_of_it():
    eye = look_at((0, 0, 6), (0, 0, 0), width=200, height=200, field_of_view=60, up=(0, 1, 0))
    motion = Motion(points=np.array([[-1.0, -1, -1], [1, 1, 1]]), frames=np.zeros(2, dtype=int))
    scenery = draw_scenery([FLOOR], eye, centre=motion.centre, reach=motion.reach)
    shadowed = ShadowedScenery.of(scenery, eye, Lamp.of([FLOOR], motion))

    class Seen(Disc):
        def render(self, splats, camera, *, occluders=None):
            before = Disc.render(self, splats, camera)
            return replace(before, alpha=before.alpha * (camera.project(splats.means)[1][0] < occluders))

    def darkened(place):
        splats = RenderInput(
            means=np.array([place]), opacities=np.ones(1), harmonics=np.zeros((1, 1, 3)), covariances=np.zeros((1, 6))
        )
        return 1 - shadowed.under(splats, Seen()).colour[:, :, 0] / scenery.colour[:, :, 0]

    assert not darkened((0.0, 0.0, -0.5)).any()
    area = np.pi * 0.04 / (LIGHT[2] / np.linalg.norm(LIGHT)) * 0.45
    for corner in ((-1.0, -1.0, 0.5), (1.0, 1.0, 0.5), (1.0, -1.0, 0.9)):
        assert darkened(corner).sum() * (6 / eye.focal_x) ** 2 == pytest.approx(area, rel=0.05)


LAMP = 1e4 * LIGHT
"""So far that its rays are parallel to 1e-4."""
DOWN = LIGHT / LIGHT[2]
"""A shadow falls so far aside, for each metre that what casts it is above the floor."""


def shade(*colliders, eye=None, time=0.0):
    """By how much of itself each pixel is darker for shadows, (H, W)."""
    eye = eye or look_at((0, 0, 6), (0, 0, 0), width=200, height=200, field_of_view=60, up=(0, 1, 0))
    dark, light = (
        draw_scenery(colliders, eye, centre=np.zeros(3), reach=2.0, time=time, lamp=lamp) for lamp in (LAMP, None)
    )
    assert np.array_equal(dark.depth, light.depth)
    return np.where(light.alpha > 0, 1 - dark.colour[:, :, 0] / np.maximum(light.colour[:, :, 0], 1e-9), 0.0), eye


def test_the_shadow_of_a_ball_lies_where_the_lamp_says_and_is_as_large_as_it_has_to_be():
    for shape in (
        SphereShape(center=(0, 0, 2.5), radius=0.3),
        SignedDistanceField.sampled(
            SphereShape(center=(0, 0, 2.5), radius=0.3), (-0.4, -0.4, 2.1), (0.4, 0.4, 2.9), 0.02
        ),
    ):
        dark, eye = shade(FLOOR, Collider(shape=shape))
        y, x = np.mgrid[:200, :200] + 0.5
        (expected,), _ = eye.project(-2.5 * DOWN[None] + [0, 0, 2.5])
        found = np.array([(dark * x).sum(), (dark * y).sum()]) / dark.sum()
        # The field's ball is smaller by its sagitta, h^2 / 8 r, at the most: less than a thousandth.
        assert found == pytest.approx(expected, abs=0.2)
        assert np.median(dark[dark > 0.2]) == pytest.approx(0.45, abs=1e-6)
        # pi r^2 / cos(slope); its outline is smoothed over a pixel of which there are seventeen across.
        area = dark.sum() / 0.45 * (6 / eye.focal_x) ** 2
        assert area == pytest.approx(np.pi * 0.09 / (LIGHT[2] / np.linalg.norm(LIGHT)), rel=0.03)


def test_a_shadow_is_not_cut_off_beyond_what_moves():
    """A wall of ten metres where what happens is two metres large."""
    wall = Collider(shape=BoxShape(center=(0, 0, 1), half_extents=(5.0, 0.05, 1)))
    eye = look_at((0, 0, 12), (0, 0, 0), width=200, height=200, field_of_view=60, up=(0, 1, 0))
    dark, _ = shade(FLOOR, wall, eye=eye)
    # The floor behind it as seen from the lamp, which is at -y; from above the wall hides .05 m beside its middle.
    places = np.array([[x, 0.3, 0.0] for x in (-4.0, -2.0, 0.0, 2.0, 4.0)])
    columns, rows = np.floor(eye.project(places)[0]).astype(int).T
    assert dark[rows, columns] == pytest.approx(0.45, abs=1e-5)
    before = places * [1, -1, 1]
    columns, rows = np.floor(eye.project(before)[0]).astype(int).T
    assert not dark[rows, columns].any()


def test_planes_and_containers_cast_none_and_nothing_shades_itself():
    container = Collider(shape=BoxShape(center=(0, 0, 1), half_extents=(0.5, 0.5, 1)), side=Side.INSIDE)
    above = Collider(shape=HalfSpace(point=(0, 0, 3), normal=(0, 0, -1)))
    assert not shade(FLOOR, container, above)[0].any()
    assert not shade(BALL)[0].any() and not shade(BOX)[0].any()
    # Nor what it stands on, where they touch.
    table = Collider(shape=BoxShape(center=(0, 0, -0.5), half_extents=(1, 1, 0.5)))
    assert not shade(FLOOR, table)[0].any()


def test_a_shadow_goes_with_what_moves():
    thrown = Collider(shape=SphereShape(center=(0, 0, 4), radius=0.3), motion=SteadyMotion(velocity=(1.0, 0, 0)))
    middles = []
    for time in (0.0, 1.0):
        dark, eye = shade(FLOOR, thrown, time=time)
        middles.append((dark * (np.mgrid[:200, :200][1] + 0.5)).sum() / dark.sum())
    assert middles[1] - middles[0] == pytest.approx(eye.focal_x / 6, abs=0.5)


def test_what_lies_in_a_shadow_gets_no_darker():
    eye = look_at((0, 0, 6), (0, 0, 0), width=200, height=200, field_of_view=60, up=(0, 1, 0))
    motion = Motion(points=np.array([[-1.0, -1, 0], [1, 1, 2]]), frames=np.zeros(2, dtype=int))
    # It shades all of the floor that the splat does.
    roof = Collider(shape=BoxShape(center=(*(4 * DOWN)[:2], 4), half_extents=(1.0, 1.0, 0.01)))
    above = draw_scenery([FLOOR, roof], eye, centre=motion.centre, reach=motion.reach, lamp=LAMP)
    shadowed = ShadowedScenery.of(above, eye, Lamp.of([FLOOR], motion))
    mean = np.array([[0.0, 0.0, 0.1]])
    splats = RenderInput(means=mean, opacities=np.ones(1), harmonics=np.zeros((1, 1, 3)), covariances=np.zeros((1, 6)))
    under, floor = shadowed.under(splats, Disc()).colour, above.depth > 5.9
    assert np.array_equal(under[floor], above.colour[floor])
    alone = draw_scenery([FLOOR], eye, centre=motion.centre, reach=motion.reach, lamp=LAMP)
    darkened = replace(shadowed, scenery=alone).under(splats, Disc()).colour < alone.colour
    assert (darkened & floor[:, :, None]).sum() > 100


def test_what_moves_is_drawn_where_it_is_then():
    """A ball that goes round, and a box that is turned by 45 degrees, met by a ray along x."""
    ball = Collider(
        shape=SphereShape(center=(2.0, 0, 0), radius=0.5),
        motion=SteadyMotion(angular_velocity=(0, 0, np.pi)),
    )
    ray = np.array([[1.0, 0, 0]])
    for time, depth in ((0.0, 6.5), (1.0, 2.5), (0.5, np.inf)):
        assert nearest_hits([ball], np.array([-5.0, 0, 0]), ray, time).depth[0] == pytest.approx(depth)
    box = Collider(
        shape=BoxShape(center=(0, 0, 0), half_extents=(1, 1, 1)),
        motion=SteadyMotion(angular_velocity=(0, 0, np.pi / 4)),
    )
    hit = nearest_hits([box], np.array([-5.0, 0, 0]), ray, 1.0)
    assert hit.depth[0] == pytest.approx(5 - np.sqrt(2))
    pictures = [
        draw_scenery([ball], camera(), centre=np.array([0, 0, 1.0]), reach=2.0, time=time) for time in (0.0, 1.0)
    ]
    assert not np.array_equal(pictures[0].depth, pictures[1].depth)
