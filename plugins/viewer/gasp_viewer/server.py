"""viser's server, bound where the user said and nowhere else, and without its chatter."""

from __future__ import annotations

import errno
import ipaddress
import logging
import socket
from collections.abc import Generator
from contextlib import contextmanager

import rich
import viser

from gasp_core.errors import RenderingError
from gasp_viewer.own_page import Served, answering_own_page

__all__ = ["free_port", "is_loopback", "page_address", "serving"]

_TRIES = 100


class _LocalServer(viser.ViserServer):
    """Never asks the public relay for a share URL, which any page that is connected could make it do."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        return None


def free_port(host: str, port: int) -> int:
    """The first free port of a host from `port` on; of 0, any.

    viser looks for one itself, but waits for ever where there is none, as for a host that is not this machine.

    Raises
    ------
    RenderingError
        Where the host is none of this machine's, or no port is free.
    """
    for candidate in range(port, min(port + _TRIES, 65_536)) if port else (0,):
        try:
            return _bound(host, candidate)
        except socket.gaierror as error:
            raise RenderingError(f"--host {host}: is no known host ({error.strerror}): try 127.0.0.1") from None
        except OSError as error:
            if error.errno == errno.EACCES:
                raise RenderingError(
                    f"--port {candidate}: only the system's administrator may use it: take one above 1023"
                ) from None
            if error.errno != errno.EADDRINUSE:
                raise RenderingError(
                    f"--host {host}: cannot be listened on ({error.strerror}): try 127.0.0.1"
                ) from None
    raise RenderingError(f"--port {port}: it and those above it are taken: choose another, or 0 for any")


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a host's address."""
    return all(ipaddress.ip_address(address[0].partition("%")[0]).is_loopback for _, address in _addresses(host, 0))


def page_address(host: str, port: int) -> str:
    """What to type into a browser on this machine."""
    if host in ("0.0.0.0", "::"):
        host = "localhost"
    return f"http://{f'[{host}]' if ':' in host else host}:{port}"


@contextmanager
def serving(host: str, port: int, title: str) -> Generator[viser.ViserServer]:
    """A server on a host and port that are free, which answers its own page alone; stopped at the end."""
    console = rich.get_console()
    was_quiet = console.quiet
    # Browsers come and go in the middle of a message; that is their business and not an error to be printed.
    logging.getLogger("websockets").addHandler(logging.NullHandler())
    # viser announces its address, every stop and more on the shared console.
    console.quiet = True
    try:
        served = Served.by(host, [address for _, (address, _) in _addresses(host, port)])
        server: viser.ViserServer | None = None
        try:
            with answering_own_page(served):
                server = _LocalServer(host=host, port=port, label=title, verbose=False)
            server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
            yield server
        finally:
            if server is not None:
                server.stop()
    finally:
        console.quiet = was_quiet


def _addresses(host: str, port: int) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
    if not host:
        raise socket.gaierror(socket.EAI_NONAME, "it is empty")
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    return [(family, (str(address[0]), int(address[1]))) for family, _, _, _, address in found]


def _bound(host: str, port: int) -> int:
    """Listen on all addresses of a host for a moment, as the server will."""
    for family, (address, _) in _addresses(host, port):
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            # As asyncio does: a port whose last connection has only just ended is free.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family is socket.AF_INET6:
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            probe.bind((address, port))
            probe.listen(1)
            port = probe.getsockname()[1]
    return port
