"""What notebooks are given to show."""

import base64
import dataclasses
import io
import re

import numpy as np
import pytest
from PIL import Image

import gasp_core as gasp
from gasp_core import notebooks
from gasp_core.rendering.inline import html_of
from gasp_core.toy import make_toy

pytestmark = pytest.mark.usefixtures("dots")


def picture_in(html):
    (data,) = re.findall(r"data:image/png;base64,([^\"]+)", html)
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))


def shape_in(html):
    """Height over width of what is not white."""
    rows, columns = ((picture_in(html) < 250).any(axis=2).any(axis=axis) for axis in (1, 0))
    return np.ptp(np.flatnonzero(rows)) / np.ptp(np.flatnonzero(columns))


@pytest.mark.parametrize(
    ("turn", "up"), [([0, 1, 2], "+z"), ([0, 2, 1], "-y")], ids=["upright in +z", "upright along y"]
)
def test_what_stands_on_thin_feet_is_shown_upright(turn, up):
    toy = make_toy(500)
    html = toy.with_(means=toy.means[:, turn])._repr_html_()
    assert f"500 Gaussians, degree 1, seen {up} up" in html
    assert shape_in(html) > 1


def test_a_scene_is_shown_as_it_begins_and_code_of_its_own_is_not_run(cloud, tmp_path):
    module = tmp_path / "evil.py"
    module.write_text("raise SystemExit('run')\n")
    material = gasp.Elastic(density=200, youngs_modulus=3e4, poissons_ratio=0.3)
    still = gasp.SplatObject(name="<b>wall</b>", splat=cloud(30, 1), static=True, height=1, position=(0, 1, 0))
    moving = gasp.SplatObject(
        name="toy",
        splat=cloud(30, 2, degree=1),
        height=1,
        material=material,
        motion=gasp.PythonMotion(function=f"{module}:psi"),
    )
    html = html_of(gasp.Scene(duration=1.5, frame_rate=10, objects=(still, moving)))
    assert "&lt;b&gt;wall&lt;/b&gt;, toy: 1.5 s, warp-mpm" in html
    assert picture_in(html).shape == (360, 640, 3)
    assert (picture_in(html) < 250).any()


def test_where_there_is_no_picture_there_is_the_reason(cloud):
    nothing = cloud().with_(scales=np.zeros((40, 3)))
    html = html_of(nothing)
    assert html.startswith("<pre>Gaussians(")
    assert "no picture: " in html
    assert "none of its 40 Gaussians is left" in html
    empty = cloud().select([])
    assert "no picture: " in html_of(empty)


def test_outside_of_notebooks_there_is_none(monkeypatch):
    assert not notebooks.in_notebook()
    shell = type("Shell", (), {"kernel": None})()
    monkeypatch.setitem(notebooks.sys.modules, "IPython", type("IPython", (), {"get_ipython": lambda: shell}))
    assert notebooks.in_notebook()


def test_a_class_that_is_shown_stays_what_it_was(cloud):
    gaussians = cloud()
    assert dataclasses.is_dataclass(gaussians)
    with pytest.raises(AttributeError):
        object.__setattr__(gaussians, "other", 1)
