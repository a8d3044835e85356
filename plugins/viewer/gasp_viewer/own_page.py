"""Whom the socket answers: the page that it serves itself, and no other that a browser shows.

Any page may open a websocket to any address, this machine's own too, and browsers leave it to the server to refuse.
They do say who asks: `Origin` is the page's place, `Host` the one that was asked for. A page whose name somebody has
turned to point at this machine (DNS rebinding) comes with both of one kind, so `Host` must be a name that is served,
and `Origin` the very same place. The port need not be ours: through a tunnel, ssh -L, the page is at another.
"""

from __future__ import annotations

import functools
import http
import ipaddress
import socket
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from gasp_core.errors import RenderingError

__all__ = ["Served", "answering_own_page"]

Answer = Callable[[ServerConnection, Request], Response | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """The names under which a server is found.

    Parameters
    ----------
    names
        In lower case.
    any_address
        Whether every number is one of them, as of a server that listens on all that the machine has: nobody can have a
        number point elsewhere, a name anybody.
    """

    names: frozenset[str]
    any_address: bool

    @classmethod
    def by(cls, host: str, addresses: Sequence[str]) -> Served:
        """What a server is found by that was told to listen on a host, which has these addresses."""
        found = [ipaddress.ip_address(address.partition("%")[0]) for address in addresses]
        names = {host.lower(), *(str(address) for address in found)}
        everywhere = any(address.is_unspecified for address in found)
        if everywhere or any(address.is_loopback for address in found):
            names |= {"localhost", "127.0.0.1", "::1"}
        if everywhere:
            own = socket.gethostname().lower()
            names |= {own, own.partition(".")[0], f"{own.partition('.')[0]}.local"}
        return cls(names=frozenset(names - {""}), any_address=everywhere)

    def admits(self, hosts: Sequence[str], origins: Sequence[str]) -> bool:
        """Whether a request with these headers is of our own page, or of no page at all."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if origins and origins[0].lower() != f"http://{hosts[0].lower()}":
            return False
        try:
            name = urlsplit(f"//{hosts[0]}").hostname or ""
        except ValueError:
            return False
        return name in self.names or (self.any_address and _is_address(name))


@contextmanager
def answering_own_page(served: Served) -> Generator[None]:
    """Have the server that is started meanwhile refuse all else, with status 403.

    viser has no place to say so: it calls `websockets.asyncio.server.serve`, which therefore is another here.

    Raises
    ------
    RenderingError
        Where viser has started its server in some other way: unguarded, it is not left running.
    """
    serve = websockets.asyncio.server.serve
    guarded: list[bool] = []

    @functools.wraps(serve)
    def guarding(*arguments: Any, process_request: Answer, **others: Any) -> Any:
        guarded.append(True)
        return serve(*arguments, process_request=_answer(served, process_request), **others)

    websockets.asyncio.server.serve = guarding  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve
    if not guarded:
        raise RenderingError("this version of viser cannot be kept from answering every page: install viser 1.1.1")


def _answer(served: Served, page: Answer) -> Answer:
    def answered(connection: ServerConnection, request: Request) -> Response | None:
        if served.admits(request.headers.get_all("Host"), request.headers.get_all("Origin")):
            return page(connection, request)
        said = "gasp view answers its own page only; to be found by another name, it wants --host NAME\n"
        return connection.respond(http.HTTPStatus.FORBIDDEN, said)

    return answered


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
