from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import settings

# A slow machine is not a failure.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# Tests share a module beside them, which the way that pytest imports here does not put on the path.
sys.path.insert(0, str(Path(__file__).parent))
