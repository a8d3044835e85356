"""The page in a real browser: it plays, and its pixels are those of our own renderer."""

from __future__ import annotations

import importlib.util
import io
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from gasp_core import MovingSplat, Reduction, pack, read_splat
from gasp_core.accuracy.images import psnr
from gasp_core.contract import (
    BoxShape,
    Collider,
    HalfSpace,
    Sand,
    Side,
    SignedDistanceField,
    SphereShape,
    SteadyMotion,
)
from gasp_core.moving.html import write_page
from gasp_core.rendering.camera import look_at
from gasp_core.rendering.renderers import open_renderer
from gasp_core.rendering.scenery import draw_scenery

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

NAMES = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT, BAR = 480, 360, 44
# No GPU: the driver is a program.
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]


def chromium():
    own = os.environ.get("GASP_CHROMIUM")
    return own or next((path for name in NAMES if (path := shutil.which(name))), None)


pytestmark = [
    pytest.mark.skipif(
        chromium() is None, reason=f"no browser: none of {', '.join(NAMES)} on PATH (set GASP_CHROMIUM)"
    ),
    pytest.mark.skipif(
        importlib.util.find_spec("gasp_renderer") is None, reason="no renderer here: pip install -e plugins/renderer"
    ),
]


@pytest.fixture
def opened():
    """opened(path) -> a page that is painted, without a network, and what it complained about."""
    with playwright.sync_playwright() as machine:
        browser = machine.chromium.launch(executable_path=chromium(), args=FLAGS)

        def open_page(path):
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT + BAR})
            page.context.set_offline(True)
            complaints = []
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
            page.goto(path.resolve().as_uri())
            return page, complaints

        yield open_page
        browser.close()


def painted(page):
    page.wait_for_function("window.gasp && gasp.state.painted > 0", timeout=120_000)


def picture(page, frame):
    """What is on the canvas in a frame, over white, (H, W, 3)."""
    from PIL import Image

    page.evaluate(f"gasp.play(false), gasp.seek({frame})")
    page.wait_for_function(f"gasp.state.shown === {frame} && !gasp.state.changed", timeout=120_000)
    shot = page.screenshot(clip={"x": 0, "y": 0, "width": WIDTH, "height": HEIGHT})
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")) / 255.0


def drawn(splat, frame, colliders=()):
    camera = splat.header.camera
    angle = camera["vertical_angle"]
    seen = look_at(camera["position"], camera["target"], width=WIDTH, height=HEIGHT, field_of_view=angle)
    time = splat.times[frame]
    scenery = draw_scenery(
        colliders, seen, centre=np.array(camera["target"]), reach=camera.get("reach", 1.0), time=time
    )
    found = open_renderer().render(splat.drawn(frame), seen, occluders=scenery.depth).before(scenery)
    return np.clip(found.over(np.ones(3)), 0, 1)


SAND = Sand(density=1600, youngs_modulus=1e5, poissons_ratio=0.3, friction_angle=30)
CAMERA = {"position": [0.9, -1.1, 0.7], "target": [0.0, 0.0, 0.35], "vertical_angle": 40.0}


def test_its_pixels_are_those_of_our_renderer(recorded, opened, ball, tmp_path):
    """A ball with harmonics of degree 3 that spins apart, at the start and at the end."""
    rng = np.random.default_rng(0)
    base = np.clip(ball.means[:, None] * 0.6, -1, 1)
    harmonics = np.concatenate([base, rng.normal(scale=0.15, size=(len(ball), 15, 3))], axis=1).astype(np.float32)
    recording = recorded(Reduction(mode="volume"), ball.with_(harmonics=harmonics))
    pack(recording, tmp_path / "a.sog", camera=CAMERA)
    write_page(tmp_path / "a.html", (tmp_path / "a.sog").read_bytes(), "a <ball> & more {{ script }}")
    splat = MovingSplat.open(tmp_path / "a.sog")
    page, complaints = opened(tmp_path / "a.html")
    painted(page)
    assert page.title() == "a <ball> & more {{ script }}"
    pictures = []
    for frame in (0, len(splat) - 1):
        pictures.append(picture(page, frame))
        alike = psnr(drawn(splat, frame), pictures[-1])
        print(f"frame {frame}: {alike:.1f} dB")
        assert alike >= 28
    # It is a picture, and another one each time.
    assert psnr(pictures[0], np.ones_like(pictures[0])) < 20
    assert psnr(*pictures) < 25
    assert complaints == []


def bowl():
    """A thick cup that is open upwards, on a grid."""
    x, y, z = np.moveaxis(np.indices((61, 51, 41)) * 0.02 - [[[[0.6]]], [[[0.5]]], [[[0.1]]]], 0, 0)
    outer, inner = np.sqrt(x**2 + y**2 + (z - 0.3) ** 2) - 0.36, np.sqrt(x**2 + y**2 + (z - 0.45) ** 2) - 0.33
    return SignedDistanceField(origin=(-0.6, -0.5, -0.1), spacing=0.02, values=np.maximum(outer, -inner))


SOLID = {
    "plane": Collider(shape=HalfSpace(point=(0, 0, 0.2), normal=(0, -0.6, 0.8))),
    "far side of a plane": Collider(shape=HalfSpace(point=(0, 0.3, 0), normal=(0, 1, 0)), side=Side.INSIDE),
    "box": Collider(shape=BoxShape(center=(0.2, -0.2, 0.2), half_extents=(0.3, 0.1, 0.2))),
    "room": Collider(shape=BoxShape(center=(0, 0, 0.5), half_extents=(2, 1.5, 0.8)), side=Side.INSIDE),
    "ball": Collider(shape=SphereShape(center=(-0.1, -0.1, 0.3), radius=0.25)),
    "shell": Collider(shape=SphereShape(center=(0, 0, 0.3), radius=0.5), side=Side.INSIDE),
    "field": Collider(shape=bowl()),
    "inside of a field": Collider(shape=bowl(), side=Side.INSIDE),
    "turning box": Collider(
        shape=BoxShape(center=(0.2, -0.2, 0.2), half_extents=(0.3, 0.1, 0.2)),
        motion=SteadyMotion(velocity=(1, 0, 2), angular_velocity=(3, 9, 5), center=(0.1, 0, 0.3)),
    ),
    "turning field": Collider(
        shape=bowl(), motion=SteadyMotion(velocity=(0, 0, 3), angular_velocity=(9, 5, 3), center=(0, 0, 0.3))
    ),
    "tilting plane": Collider(
        shape=HalfSpace(point=(0, 0, 0.2), normal=(0, 0, 1)), motion=SteadyMotion(angular_velocity=(4, 9, 2))
    ),
}


@pytest.mark.parametrize(
    "names",
    [
        *(pytest.param([name], marks=pytest.mark.thorough) for name in SOLID),
        ["plane", "turning box", "ball", "field", "turning field"],
    ],
    ids=" ".join,
)
def test_what_is_solid_is_drawn_as_our_renderer_does(recorded, opened, ball, tmp_path, names):
    """In front of Gaussians and behind them, and of those that reach through it what is before it."""
    colliders = [SOLID[name] for name in names]
    recording = recorded(Reduction(mode="volume"), ball)
    pack(recording, tmp_path / "a.sog", camera={**CAMERA, "reach": 0.8}, colliders=colliders)
    write_page(tmp_path / "a.html", (tmp_path / "a.sog").read_bytes(), "ball")
    splat = MovingSplat.open(tmp_path / "a.sog")
    page, complaints = opened(tmp_path / "a.html")
    painted(page)
    found = picture(page, 1)
    alike = psnr(drawn(splat, 1, colliders), found)
    without = psnr(drawn(splat, 1), found)
    print(f"{' '.join(names)}: {alike:.1f} dB, {without:.1f} dB from a picture without")
    assert alike >= 28
    assert without < alike - 6
    assert complaints == []


def test_what_has_flowed_is_drawn_as_grains(flowing, opened, tmp_path):
    pack(flowing(SAND), tmp_path / "a.sog", camera=CAMERA)
    write_page(tmp_path / "a.html", (tmp_path / "a.sog").read_bytes(), "sand")
    splat = MovingSplat.open(tmp_path / "a.sog")
    page, complaints = opened(tmp_path / "a.html")
    painted(page)
    for frame in (0, len(splat) // 2, len(splat) - 1, 0):
        alike = psnr(drawn(splat, frame), picture(page, frame))
        print(f"frame {frame}: {alike:.1f} dB")
        assert alike >= 28
    last = len(splat) - 1
    assert len(splat.drawn(last)) > 2 * len(splat.reference)
    assert complaints == []


def test_it_plays_and_can_be_taken_hold_of(recorded, opened, tmp_path):
    pack(recorded(Reduction(mode="cores", count=30)), tmp_path / "a.sog", camera=CAMERA)
    write_page(tmp_path / "a.html", (tmp_path / "a.sog").read_bytes(), "ball")
    page, complaints = opened(tmp_path / "a.html")
    painted(page)
    page.wait_for_function("gasp.state.shown > 1", timeout=60_000)
    page.click("#play")
    assert page.evaluate("gasp.state.playing") is False
    before = picture(page, 1)
    page.keyboard.press("ArrowRight")
    page.wait_for_function("gasp.state.shown === 2")
    page.mouse.move(200, 150)
    page.mouse.down()
    page.mouse.move(320, 170)
    page.mouse.up()
    page.mouse.wheel(0, -300)
    turned = picture(page, 1)
    assert psnr(before, turned) < 30
    page.evaluate(
        "document.querySelector('#time').value = 0, document.querySelector('#time').dispatchEvent(new Event('input'))"
    )
    page.wait_for_function("gasp.state.shown === 0")
    page.keyboard.press("Space")
    page.wait_for_function("gasp.state.playing && gasp.state.shown > 0")
    assert complaints == []


def test_what_is_damaged_says_so(recorded, opened, tmp_path):
    pack(recorded(Reduction(mode="volume")), tmp_path / "a.sog")
    content = (tmp_path / "a.sog").read_bytes()
    write_page(tmp_path / "a.html", content[: len(content) // 2], "half a ball")
    page, complaints = opened(tmp_path / "a.html")
    page.wait_for_function("document.body.classList.contains('failed')", timeout=60_000)
    assert "cut off" in page.inner_text("#told")
    assert len(complaints) == 1


@pytest.mark.thorough
def test_a_capture(data, opened, scene_of, run, tmp_path):
    """The skull, degree 3, as its file has it: what a reader of .sog that is ours sees, the page sees."""
    skull = read_splat(data / "splats/skull.sog")
    recording = run(
        scene_of(skull, up="-y", height=0.5, reduction=Reduction(mode="cores", count=200)),
        tmp_path / "a.gasp",
        frames=3,
    )
    pack(recording, tmp_path / "a.sog", camera={**CAMERA, "position": [0.5, -1.2, 0.5], "target": [0.0, 0.0, 0.0]})
    write_page(tmp_path / "a.html", (tmp_path / "a.sog").read_bytes(), "skull")
    splat = MovingSplat.open(tmp_path / "a.sog")
    page, complaints = opened(tmp_path / "a.html")
    painted(page)
    alike = psnr(drawn(splat, 2), picture(page, 2))
    print(f"skull: {alike:.1f} dB")
    assert alike >= 28
    assert complaints == []
    assert Path(tmp_path / "a.html").stat().st_size < 15e6
