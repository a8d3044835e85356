"""Where in our kernels Taichi's compiler is, in one line instead of a drawing.

For every node of a kernel's syntax tree, some 10^4 in ours, Taichi copies the lines of source it is from and underlines
it, wrapped to 80 columns, for an error that hardly ever comes: half of what its translation takes, at every start, as
that is not kept in Taichi's cache. Of functions of ours it is told file, line and name; all others are drawn as before.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

__all__ = ["tell_positions_in_a_line"]

_OURS = str(Path(__file__).parent)


def tell_positions_in_a_line(context: Any) -> None:
    """Replace `get_pos_info` of Taichi's class of what a function is translated in; one without it is left as it is."""
    drawn = getattr(context, "get_pos_info", None)
    if drawn is None or getattr(drawn, "of_gasp", False):
        return

    def get_pos_info(self: Any, node: Any) -> str:
        if not self.file.startswith(_OURS):
            return drawn(self, node)
        return f'File "{self.file}", line {node.lineno + self.lineno_offset}, in {self.func.func.__name__}:\n'

    get_pos_info.of_gasp = True  # type: ignore[attr-defined]
    context.get_pos_info = get_pos_info
