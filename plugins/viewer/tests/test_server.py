import os
import socket
import urllib.request

import psutil
import pytest
from gasp_viewer.server import free_port, is_loopback, page_address, serving

from gasp_core.errors import RenderingError

HERE = "127.0.0.1"


def listened(port):
    """Addresses this process listens on at a port."""
    connections = psutil.Process(os.getpid()).net_connections(kind="inet")
    return {c.laddr.ip for c in connections if c.status == psutil.CONN_LISTEN and c.laddr.port == port}


@pytest.fixture
def taken():
    with socket.create_server((HERE, 0)) as server:
        yield server.getsockname()[1]


def test_it_listens_on_the_address_it_was_given_and_on_no_other():
    with serving(HERE, free_port(HERE, 0), "t") as server:
        port = server.get_port()
        assert listened(port) == {HERE}
        with urllib.request.urlopen(f"http://{HERE}:{port}") as page:
            assert b"<html" in page.read(200_000).lower()
        # All of 127.0.0.0/8 is this machine: another address of it must find nobody.
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=5)
    assert listened(port) == set()


def test_a_port_that_is_taken_gives_way_to_the_next_that_is_free(taken):
    port = free_port(HERE, taken)
    assert taken < port < taken + 100
    with serving(HERE, port, "t") as server:
        assert server.get_port() == port


def test_port_zero_is_any():
    assert 1024 <= free_port(HERE, 0) <= 65_535


def test_no_free_port_is_an_error_and_not_a_hang():
    with socket.socket() as last:
        last.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            last.bind((HERE, 65_535))
        except OSError:
            pytest.skip("port 65535 is in use by something else")
        last.listen()
        with pytest.raises(RenderingError, match="--port 65535: it and those above it are taken"):
            free_port(HERE, 65_535)


@pytest.mark.parametrize("host", ["203.0.113.7", "no-such-host.invalid", ""])
def test_a_host_that_is_not_here_is_an_error_and_not_a_hang(host):
    with pytest.raises(RenderingError, match="--host"):
        free_port(host, 0)


@pytest.mark.parametrize(
    ("host", "loopback"), [(HERE, True), ("127.0.0.9", True), ("localhost", True), ("0.0.0.0", False)]
)
def test_who_can_reach_it(host, loopback):
    assert is_loopback(host) is loopback


def test_addresses_to_type():
    assert page_address(HERE, 80) == "http://127.0.0.1:80"
    assert page_address("0.0.0.0", 80) == "http://localhost:80"
    assert page_address("::1", 80) == "http://[::1]:80"


def test_it_says_nothing_and_shares_nothing(capfd):
    with serving(HERE, free_port(HERE, 0), "t") as server:
        assert server.request_share_url() is None
    assert capfd.readouterr() == ("", "")
