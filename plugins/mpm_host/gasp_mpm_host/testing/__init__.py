"""Tests that every engine for explicit MPM has to pass, to be subclassed beside its own; they need pytest.

An engine's tests say `class TestSession(SessionTests)` and have a fixture `kit`, a `Kit` made of the engine's `open`.
Nothing here imports a backend or an engine.
"""

from gasp_mpm_host.testing.agreement import AgreementTests
from gasp_mpm_host.testing.checkpoints import CheckpointTests
from gasp_mpm_host.testing.contact import ContactTests
from gasp_mpm_host.testing.decompositions import DecompositionTests
from gasp_mpm_host.testing.extremes import ExtremesTests
from gasp_mpm_host.testing.kit import Kit
from gasp_mpm_host.testing.sessions import SessionTests
from gasp_mpm_host.testing.tracers import TracerTests

__all__ = [
    "AgreementTests",
    "CheckpointTests",
    "ContactTests",
    "DecompositionTests",
    "ExtremesTests",
    "Kit",
    "SessionTests",
    "TracerTests",
]
