"""Sessions as those of every engine for explicit MPM, and what is this one's own."""

import subprocess
import sys

from gasp_mpm_host import layout as at
from gasp_mpm_host.testing import SessionTests, TracerTests
from gasp_mpm_host.testing.kit import falling


class TestSession(SessionTests):
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


def test_plugin_imports_no_backend():
    code = "import sys, gasp_warp_mpm.plugin as p; p.gasp_point_engines(); sys.exit('warp' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
