"""``gasp export --motion``: a body's rigid motion as a file of moments."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

from gasp_core.cli.overwriting import keep_what_is_there
from gasp_core.io.atomic import replacing

if TYPE_CHECKING:
    from gasp_core.recording import Recording

__all__ = ["export_motion"]


def export_motion(recording: Recording, name: str, path: Path | None, *, overwrite: bool) -> str:
    """Write the motion that is nearest to an object's, and return what the user is told.

    Raises
    ------
    click.UsageError
        Where the file is there already.
    RecordingError, SplatFormatError
        Where nothing of that name moves, or the file cannot be written.
    """
    from gasp_core.recording.rigid_fits import rigid_fit

    if path is None:
        path = Path("_".join((recording.path.resolve().stem, re.sub(r"[^\w.-]", "_", name))) + ".csv")
    keep_what_is_there([path], overwrite)
    fit = rigid_fit(recording, name)
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(("time", "x", "y", "z", "qw", "qx", "qy", "qz", "residual"))
    for row in zip(fit.times.tolist(), fit.places.tolist(), fit.quaternions.tolist(), fit.residuals.tolist()):
        time, place, quaternion, residual = row
        lines.writerow((time, *place, *quaternion, residual))
    with replacing(path) as stream:
        stream.write(text.getvalue().encode())
    center = ", ".join(f"{value:.9g}" for value in fit.center)
    return (
        f'{path}: {len(fit.times)} moments of the point that was at [{center}] at the start; "{name}" is off by '
        f"{fit.residuals.max():.2g} m at the most"
    )
