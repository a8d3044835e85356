from __future__ import annotations

import subprocess
import sys


def test_listing_engines_imports_no_mujoco():
    code = "import sys, gasp_mujoco_flex.plugin as p; p.gasp_point_engines(); sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
