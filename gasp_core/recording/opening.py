"""The header of a recording, read and checked: whether a folder is one at all."""

from __future__ import annotations

from pathlib import Path

from gasp_core.errors import RecordingError
from gasp_core.io.near_files import did_you_mean_file
from gasp_core.recording.checks import check_header
from gasp_core.recording.files import short
from gasp_core.recording.layout import Header
from gasp_core.recording.nodes import read_node, whole

__all__ = ["read_header"]


def read_header(path: Path) -> Header:
    """The header of the recording in a folder.

    Raises
    ------
    RecordingError
        Where there is none, it is damaged, or of a newer version.
    """
    if path.exists() and not path.is_dir():
        raise RecordingError(f"{path}: is a file, a recording is a folder that gasp run wrote")
    try:
        node, content = read_node(path, "zarr.json")
    except FileNotFoundError:
        what = "is no recording (no zarr.json in it)" if path.exists() else "there is no such recording"
        near = "" if path.exists() else did_you_mean_file(path)
        raise RecordingError(f"{path}: {what}: name a folder that gasp run wrote{near}") from None
    header = Header.of(node["attributes"], path)
    # A version that damage made an earlier one must not do away with the seal.
    if (header.files or "checksum" in node["attributes"]) and not whole(content):
        raise RecordingError(f"{path}: zarr.json is damaged: its checksum is another")
    try:
        check_header(header)
    except (ValueError, TypeError, AttributeError) as error:
        raise RecordingError(f"{path}: the header of the recording is damaged ({short(error)})") from None
    return header
