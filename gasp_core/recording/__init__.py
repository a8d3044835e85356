"""What a run leaves behind: a Zarr store that is readable at any moment, whatever happened to the run."""

from __future__ import annotations

from gasp_core.recording.reader import Recording

__all__ = ["Recording"]
