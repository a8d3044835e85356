"""Hosts of SSH as file systems: only those that are known, with the keys that `ssh` would use, and never for ever.

fsspec's own takes whoever answers for the host that was meant, and waits for one that has gone silent.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

__all__ = ["PROTOCOLS", "ssh_files"]

PROTOCOLS = ("ssh", "sftp")
_PORT = 22
_ANSWER, _SILENCE, _ALIVE = 30.0, 60.0, 30
"""[s]: for a host to answer, without a word in the middle of something, and between words that nobody asked for."""


def ssh_files(address: str) -> tuple[Any, str]:
    """The file system of an address, ``ssh://user@host:port/path``, newly connected, and the path there.

    Names, ports, users, identity files and jumps of ``~/.ssh/config`` hold; commands in the place of a connection
    (``ProxyCommand``) do not.

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
            # A client that nobody holds is closed, and with it what is reached through it.
            self.hops = _reached(paramiko, self.host, self.ssh_kwargs, [], ())
            self.client = self.hops[-1]
            self.ftp = self.client.open_sftp()
            self.ftp.get_channel().settimeout(_SILENCE)

    files: Any = KnownHost(**base._get_kwargs_from_urls(address), skip_instance_cache=True)
    return files, str(base._strip_protocol(address))


def _reached(paramiko: Any, name: str, given: Mapping[str, Any], hops: list[Any], to: tuple[str, ...]) -> list[Any]:
    """Clients of the hosts on the way to one, in the order of the way, and of itself.

    Parameters
    ----------
    name
        As it was asked for.
    given
        User and port, where they were said beside it.
    hops
        Clients of the way so far: the first host of a way may have one of its own, as with `ssh`, the others have not.
    to
        Hosts that are reached through this one: none of them is on the way to it, whatever a pattern says.
    """
    told, jumps = _configured(paramiko, name)
    told |= given
    if not hops and jumps not in ("", "none"):
        for jump in jumps.split(","):
            at, of_it = _jump(jump)
            if at not in (name, *to):
                hops = _reached(paramiko, at, of_it, hops, (*to, name))
    return [*hops, _connected(paramiko, hops, told.pop("hostname", name), told.pop("port", _PORT), told)]


def _connected(paramiko: Any, hops: list[Any], host: str, port: int, told: Mapping[str, Any]) -> Any:
    client = paramiko.SSHClient()
    client.load_system_host_keys()
    client.set_missing_host_key_policy(paramiko.RejectPolicy())
    waits = dict.fromkeys(("timeout", "banner_timeout", "auth_timeout"), _ANSWER)
    way = None if not hops else _opened(paramiko, hops[-1], (host, port))
    client.connect(host, **{"port": port, "sock": way, **waits, **told})
    client.get_transport().set_keepalive(_ALIVE)
    return client


def _opened(paramiko: Any, door: Any, to: tuple[str, int]) -> Any:
    """A channel through a host to another."""
    try:
        return door.get_transport().open_channel("direct-tcpip", to, ("127.0.0.1", 0), timeout=_ANSWER)
    except paramiko.ChannelException as error:
        raise OSError(f"the host on the way to {to[0]}:{to[1]} does not lead there: {error.text}") from None


def _jump(text: str) -> tuple[str, dict[str, Any]]:
    """A host of ``ProxyJump``, ``[user@]host[:port]`` or such an address, and what is said of it."""
    found = urlsplit(text if "://" in text else f"ssh://{text}")
    given = {"username": found.username, "port": found.port}
    return found.hostname or text, {key: value for key, value in given.items() if value is not None}


def _configured(paramiko: Any, host: str) -> tuple[dict[str, Any], str]:
    """What ``~/.ssh/config`` says of a host, as `paramiko.SSHClient.connect` takes it, and its jumps."""
    try:
        told = paramiko.SSHConfig.from_path(str(Path.home() / ".ssh" / "config")).lookup(host)
    except OSError:
        return {}, ""
    found: dict[str, Any] = {"hostname": told.get("hostname", host)}
    if "user" in told:
        found["username"] = told["user"]
    if "port" in told:
        found["port"] = int(told["port"])
    if "identityfile" in told:
        found["key_filename"] = told["identityfile"]
    return found, told.get("proxyjump", "")
