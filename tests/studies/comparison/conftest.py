import dataclasses
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

import gasp_core as gasp
from gasp_core.discovery.registry import discover
from gasp_core.toy import make_toy

FAKES = Path(__file__).parents[2] / "fake_plugins"
ODD = "toy <script>document.title = 'broken'</script> & $x_1$"
SIZE = (96, 72)


@contextmanager
def _installed():
    """The engines of the tests, found by the processes that are started here too."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("frail", "ballistic"):
            patch.syspath_prepend(FAKES / name)
        discover.cache_clear()
        yield
    discover.cache_clear()
    for name in [name for name in sys.modules if name.startswith("fake_")]:
        del sys.modules[name]


@pytest.fixture(scope="module", autouse=True)
def installed():
    """Not for longer than these tests: others of the same process ask what is installed."""
    with _installed():
        yield


@pytest.fixture(scope="session")
def size():
    """Of a picture [px]."""
    return SIZE


@pytest.fixture(scope="session")
def toy():
    return make_toy(64)


@pytest.fixture(scope="session")
def scene_of(toy):
    """Makes a scene of a falling toy, six frames; options go to the frail engine."""

    def make(**options):
        material = gasp.Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3)
        item = gasp.SplatObject(name=ODD, splat=toy, height=0.3, material=material, velocity=(0.5, 0, 0))
        engine = gasp.EngineChoice(name="frail", options=options)
        return gasp.Scene(duration=0.2, frame_rate=25, objects=(item,), engine=engine)

    return make


@pytest.fixture(scope="session")
def whole(scene_of, tmp_path_factory):
    """A comparison of two engines that fall, and of one that is not ready."""
    scene = dataclasses.replace(scene_of(), duration=0.8)
    folder = tmp_path_factory.mktemp("whole") / "scene.compare"
    with _installed():
        return gasp.compare(scene, ["ballistic", "frail", "away"], folder, name="<script>alert(1)</script>", size=SIZE)
