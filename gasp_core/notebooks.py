"""What is shown in notebooks: whether this is one, and what things look like there."""

from __future__ import annotations

import importlib
import sys

__all__ = ["ShownInNotebooks", "in_notebook"]

_DRAWING = "gasp_core.rendering.inline"
"""Draws what is shown, and so stands above all of it: it is imported when something is to be drawn, and not before."""


def in_notebook() -> bool:
    """Whether this is the kernel of a notebook: Jupyter, JupyterLab, VS Code, Colab."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return hasattr(shell, "kernel")


class ShownInNotebooks:
    """Is drawn where a notebook shows it; where it cannot be, its text and the reason stand there instead."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return str(importlib.import_module(_DRAWING).html_of(self))
