"""Who opens an address: fsspec, and by ssh what this package knows of hosts."""

from __future__ import annotations

import importlib
import logging
import re
from typing import Any

from gasp_core.errors import RecordingError
from gasp_core.recording.ssh_hosts import PROTOCOLS, ssh_files

__all__ = ["file_system", "said"]

_PASSWORD = re.compile(r"([^:/]+:/{1,2}[^/@:]*):[^/]*@")
_TALKATIVE = ("fsspec", "gcsfs", "s3fs", "paramiko.transport")
"""Loggers of file systems, which print what they try where nobody has said what to do with it."""
_UNHEARD = logging.NullHandler()


def file_system(address: str, *, anew: bool = False) -> tuple[Any, str]:
    """The file system of an address, and the path in it; `anew` where the connection that there was is dead.

    Raises
    ------
    RecordingError
        Where a password is in it, nobody opens such addresses, or what it takes for them is not installed.
    """
    if _PASSWORD.match(address):
        told = _PASSWORD.sub(r"\1:***@", address)
        raise RecordingError(
            f"{told}: a password here would end up in tables and logs: leave it out, and let a key open it"
        )
    try:
        fsspec: Any = importlib.import_module("fsspec")
    except ImportError:
        raise RecordingError(f"{address}: addresses are opened by fsspec: pip install 'gasp-core[remote]'") from None
    for name in _TALKATIVE:
        # Whoever logs by themselves has all of it still.
        logging.getLogger(name).addHandler(_UNHEARD)
    try:
        if address.partition(":")[0] in PROTOCOLS:
            files, root = ssh_files(address)
        else:
            files, root = fsspec.core.url_to_fs(address, skip_instance_cache=anew)
    except Exception as error:  # file systems raise whatever their libraries do
        raise RecordingError(f"{address}: cannot be opened: {said(error)}") from None
    return files, str(root).rstrip("/")


def said(error: Exception) -> str:
    """What an error says, in a line."""
    return " ".join((str(error) or type(error).__name__).split())[:200]
