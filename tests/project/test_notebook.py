"""The example notebook, run in a kernel as Jupyter runs it: pictures, a film, a bar while it goes on."""

import base64
import importlib.util
import io
import re
from pathlib import Path

import av
import nbclient
import nbformat
import numpy as np
import pytest
from PIL import Image

NOTEBOOK = Path(__file__).parents[2] / "examples" / "falling_bear.ipynb"

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("gasp_renderer") is None, reason="no renderer is installed (plugins/renderer)"
)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """HTML below each cell of code, by the last line of the cell; of what is replaced, the last."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    assert (folder / "bear.mp4").stat().st_size > 1000
    found = {}
    for cell in notebook.cells:
        if cell.cell_type == "code":
            data = [output.get("data", {}).get("text/html", "") for output in cell.outputs]
            found[cell.source.splitlines()[-1].strip()] = "\n".join(data)
    return found


def content(html, kind):
    (found,) = re.findall(rf"data:{kind};base64,([A-Za-z0-9+/=]+)", html)
    return base64.b64decode(found)


@pytest.mark.parametrize("name", ["toy", "scene"])
@pytest.mark.thorough
def test_gaussians_and_scenes_are_pictures(told, name):
    picture = np.asarray(Image.open(io.BytesIO(content(told[name], "image/png"))))
    assert picture.shape == (360, 640, 3)
    # The bear fills more than half of the height, before a white ground.
    rows = np.flatnonzero((picture < 250).any(axis=(1, 2)))
    assert len(rows) > 180


def test_a_recording_is_a_film_of_all_its_frames(told):
    with av.open(io.BytesIO(content(told["run"], "video/webm"))) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 16
    assert frames[0].shape == (360, 640, 3)
    # It falls: what is seen at the end is not what is seen at first.
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 100


def test_progress_ends_where_the_run_does(told):
    value, most, words = re.findall(r'<progress value="([\d.]+)" max="(\d+)"></progress> ([^\n]*)', told["run"])[0]
    assert float(value) == float(most) == 15
    assert words.startswith("frame 15 of 15: ")


def test_the_notebook_is_kept_without_what_it_printed():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert all(not cell.outputs and cell.execution_count is None for cell in notebook.cells if cell.cell_type == "code")
