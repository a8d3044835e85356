"""The axes that may be up, for options: `gasp_core.scene.objects` has them too, and takes long to import."""

from __future__ import annotations

__all__ = ["UP_AXES"]

UP_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
