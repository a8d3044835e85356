"""Sessions as those of every engine for explicit MPM, and what is this one's own."""

import os
import subprocess
import sys

import pytest
from gasp_mpm_host import layout as at
from gasp_mpm_host.testing import CheckpointTests, SessionTests, TracerTests
from gasp_mpm_host.testing.kit import falling
from gasp_warp_mpm import runtime

from gasp_core.errors import EngineEnvironmentError, SceneError


class TestSession(SessionTests):
    pass


class TestCheckpoints(CheckpointTests):
    pass


class TestTracers(TracerTests):
    pass


def test_a_survey_looks_at_what_was_written_alone(kit):
    """Rows of the chart are wider than what is written: memory that held anything before must not stop a run."""
    with kit.open(falling(kit), spacing=0.1) as session:
        cloud = session._held
        cloud.survey()
        written = cloud._chart.numpy().reshape(-1, at.SURVEY_WIDTH)
        assert (written[:, at.SURVEY_HIGH + 3 :] == 0).all()
        assert cloud.survey().finite


def test_an_unsolicited_word_is_never_printed():
    code = "from gasp_warp_mpm import runtime; runtime.device_for('cpu')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (result.stdout, result.stderr) == ("", "")


def test_compiling_puts_nothing_where_a_killed_process_would_leave_it(tmp_path):
    code = """
import os
import warp
from gasp_warp_mpm import runtime

@warp.kernel(module="unique")
def double(x: warp.array[float]):
    x[warp.tid()] *= 2.0

runtime.load(double.module, runtime.device_for("cpu"))
os._exit(0)  # as after a kill, nobody clears up
"""
    script, temporary = tmp_path / "script.py", tmp_path / "temporary"  # Warp reads the source of a kernel
    script.write_text(code)
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary), "WARP_CACHE_PATH": str(tmp_path / "cache")}
    subprocess.run([sys.executable, str(script)], check=True, env=environment)
    assert list((tmp_path / "cache").rglob("*.o")), "it was not compiled here"
    assert not list(temporary.iterdir())


def test_plugin_imports_no_backend():
    code = "import sys, gasp_warp_mpm.plugin as p; p.gasp_point_engines(); sys.exit('warp' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("device", ["cuda:0", "cuda:7"])
def test_a_gpu_named_by_its_index_that_is_not_there_is_said_so(device):
    import warp

    runtime.device_for("cpu")
    if warp.is_cuda_available():
        pytest.skip("there is a GPU")
    with pytest.raises(EngineEnvironmentError, match=f'device "{device}" was asked for, but Warp finds no CUDA GPU'):
        runtime.device_for(device)


def test_where_there_is_no_gpu_one_line_says_so():
    code = (
        "import sys, warp; from gasp_warp_mpm.runtime import device_for\n"
        "from gasp_core.errors import EngineEnvironmentError\n"
        "try: device_for('cuda')\n"
        "except EngineEnvironmentError as error: print(error)\n"
        "else: print('there is a GPU')"
    )
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    # Hidden from Warp a GPU leaves its driver in place, and it is the missing driver that Warp talks of.
    if "there is a GPU" in said.stdout:
        pytest.skip("Warp finds a GPU here: what it says where there is no driver cannot be heard")
    assert said.stderr == "" and said.stdout.count("\n") == 1 and "Warp finds no CUDA GPU" in said.stdout


def test_the_cpu_is_one_device():
    assert runtime.device_for("cpu:0") == runtime.device_for("cpu")
    for device in ("cpu:1", "tpu", "cuda7"):
        with pytest.raises(SceneError, match=f"has no device '{device}'"):
            runtime.device_for(device)
