import flying_points
import numpy as np
import pytest

from gasp_core import CameraChoice, Collider, Elastic, EngineChoice, Gaussians, HalfSpace, Scene, SplatObject, simulate
from gasp_core.rendering.contract import Picture
from gasp_core.rendering.framing import motion_of
from gasp_core.rendering.viewpoints import cameras_for


def blob(count=60, seed=0):
    """A small dense ball of flat colours, standing on z = 0."""
    rng = np.random.default_rng(seed)
    return Gaussians(
        means=rng.normal(size=(count, 3)) / 6 + [0, 0, 0.5],
        quaternions=rng.normal(size=(count, 4)),
        scales=np.exp(rng.uniform(-4, -2.5, size=(count, 3))),
        opacities=rng.uniform(0.5, 1, size=count),
        harmonics=rng.normal(size=(count, 1, 3)).astype(np.float32),
    )


@pytest.fixture
def falling_scene():
    """A blob that falls on a floor: seven frames."""
    return Scene(
        duration=0.24,
        frame_rate=25,
        objects=(
            SplatObject(
                name="blob", splat=blob(), material=Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3)
            ),
        ),
        colliders=(Collider(shape=HalfSpace(point=(0, 0, -0.5), normal=(0, 0, 1))),),
        engine=EngineChoice(name="ballistic"),
    )


@pytest.fixture
def run_of(tmp_path):
    """Runs a scene with the engine of the tests."""

    def go(scene, name="run.gasp", **options):
        engine = (flying_points.descriptor(), flying_points.Ballistic())
        return simulate(scene, engine=engine, out=tmp_path / name, progress=False, **options)

    return go


@pytest.fixture
def recording(run_of, falling_scene):
    return run_of(falling_scene)


class Dots:
    """A renderer that needs no plugin: each Gaussian is one opaque pixel of its constant colour, nearest in front."""

    def __init__(self):
        self.sizes, self.cameras = [], []

    def render(self, splats, camera, *, occluders=None):
        self.sizes.append((camera.width, camera.height))
        self.cameras.append(camera)
        shape = (camera.height, camera.width)
        colour, depth = np.zeros((*shape, 3), np.float32), np.full(shape, np.inf, np.float32)
        places, depths = camera.project(splats.means)
        for row in np.argsort(-depths):
            x, y = np.floor(places[row]).astype(int)
            if not (0 <= x < camera.width and 0 <= y < camera.height and depths[row] > camera.near):
                continue
            if occluders is not None and depths[row] > occluders[y, x]:
                continue
            colour[y, x] = np.clip(0.5 + 0.2820948 * splats.harmonics[row, 0], 0, 1)
            depth[y, x] = depths[row]
        return Picture(colour=colour, alpha=np.isfinite(depth).astype(np.float32), depth=depth)


@pytest.fixture
def cameras_of():
    """The cameras for all frames of a footage."""

    def cameras(footage, choice=None, *, size=(96, 64), numbers=None, renderer=None):
        numbers = range(footage.frame_count) if numbers is None else numbers
        return cameras_for(
            footage,
            choice or footage.camera or CameraChoice(),
            motion=motion_of(footage, numbers),
            subject=footage.subject,
            numbers=numbers,
            renderer=renderer or Dots(),
            width=size[0],
            height=size[1],
        )

    return cameras


@pytest.fixture(scope="session")
def dots_of():
    """Makes renderers that need no plugin."""
    return Dots


@pytest.fixture
def dots(monkeypatch):
    """The renderer of the tests in place of installed ones."""
    renderer = Dots()
    for module in ("gasp_core.rendering.filming", "gasp_core.rendering.live"):
        monkeypatch.setattr(f"{module}.open_renderer", lambda name=None: renderer)
    return renderer
