"""Views that are kept while looking, as the camera of a film: what a scene file says under [camera]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from gasp_viewer.painter import Eye

__all__ = ["Shots"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shots:
    """Where the camera is at which time.

    Parameters
    ----------
    views
        Position and target [m] by the time [s] of the film.
    field_of_view
        Of the view that was kept last [degrees].
    """

    views: Mapping[float, tuple[Eye, Eye]] = field(default_factory=dict[float, tuple[Eye, Eye]])
    field_of_view: float = 40.0

    def kept(self, time: float, position: Eye, target: Eye, field_of_view: float) -> Shots:
        """With one view more, or another one at a time that has one."""
        return Shots(views={**self.views, time: (position, target)}, field_of_view=field_of_view)

    def to_toml(self) -> str:
        """A camera that stands, or goes from view to view; nothing where none is kept."""
        if not self.views:
            return ""
        lines = ["[camera]", f"field_of_view = {self.field_of_view:.4g}"]
        if len(self.views) == 1:
            ((position, target),) = self.views.values()
            lines += [f"position = {_numbers(position)}", f"target = {_numbers(target)}"]
        else:
            lines.append("path = [")
            for time, (position, target) in sorted(self.views.items()):
                lines.append(
                    f"  {{ time = {time:.6g}, position = {_numbers(position)}, target = {_numbers(target)} }},"
                )
            lines.append("]")
        return "\n".join(lines) + "\n"


def _numbers(place: Eye) -> str:
    """To a hundred thousandth of the largest: nobody wants to read the rounding of a nought."""
    digits = 5 - math.floor(math.log10(max(1e-300, *(abs(value) for value in place))))
    return f"[{', '.join(f'{round(value, digits) + 0.0:.6g}' for value in place)}]"
