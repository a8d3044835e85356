"""Hosts of SSH as file systems: only those that are known, with the keys that `ssh` would use, and never for ever.

fsspec's own takes whoever answers for the host that was meant, and waits for one that has gone silent.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

__all__ = ["PROTOCOLS", "ssh_files"]

PROTOCOLS = ("ssh", "sftp")
_ANSWER, _SILENCE, _ALIVE = 30.0, 60.0, 30
"""[s]: for a host to answer, without a word in the middle of something, and between words that nobody asked for."""


def ssh_files(address: str) -> tuple[Any, str]:
    """The file system of an address, ``ssh://user@host:port/path``, newly connected, and the path there.

    Names, ports, users and identity files of ``~/.ssh/config`` hold; jumps do not.

    Raises
    ------
    ImportError
        Where paramiko is not installed.
    OSError, paramiko.SSHException
        Where nobody answers, the host's key is none of ``~/.ssh/known_hosts``, or none of one's own opens it.
    """
    paramiko: Any = importlib.import_module("paramiko")
    base: Any = importlib.import_module("fsspec.implementations.sftp").SFTPFileSystem

    class KnownHost(base):  # pyright: ignore[reportUntypedBaseClass]
        """A host that `ssh` has been to."""

        def _connect(self) -> None:
            self.client = paramiko.SSHClient()
            self.client.load_system_host_keys()
            self.client.set_missing_host_key_policy(paramiko.RejectPolicy())
            told = _configured(paramiko, self.host) | self.ssh_kwargs
            host = told.pop("hostname", self.host)
            waits = dict.fromkeys(("timeout", "banner_timeout", "auth_timeout"), _ANSWER)
            self.client.connect(host, **{**waits, **told})
            self.client.get_transport().set_keepalive(_ALIVE)
            self.ftp = self.client.open_sftp()
            self.ftp.get_channel().settimeout(_SILENCE)

    files: Any = KnownHost(**base._get_kwargs_from_urls(address), skip_instance_cache=True)
    return files, str(base._strip_protocol(address))


def _configured(paramiko: Any, host: str) -> dict[str, Any]:
    """What ``~/.ssh/config`` says of a host, as `paramiko.SSHClient.connect` takes it."""
    try:
        told = paramiko.SSHConfig.from_path(str(Path.home() / ".ssh" / "config")).lookup(host)
    except OSError:
        return {}
    found: dict[str, Any] = {"hostname": told.get("hostname", host)}
    if "user" in told:
        found["username"] = told["user"]
    if "port" in told:
        found["port"] = int(told["port"])
    if "identityfile" in told:
        found["key_filename"] = told["identityfile"]
    return found
