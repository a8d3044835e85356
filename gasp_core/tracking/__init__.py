"""The same Gaussians through frames that were made one by one."""

from gasp_core.tracking.tracker import Tracked, Tracker

__all__ = ["Tracked", "Tracker"]
