"""The socket answers the page that it serves itself: no other page, and no other name for this machine."""

import http.client
import socket

import pytest
import viser
from gasp_viewer import own_page
from gasp_viewer.own_page import Served, answering_own_page
from gasp_viewer.server import free_port, serving
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from gasp_core.errors import RenderingError

HERE = "127.0.0.1"
PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def port():
    with serving(HERE, free_port(HERE, 0), "t") as server:
        server.scene.add_frame("/secret")
        yield server.get_port()


def received(port, host=None, origin=None):
    """The first message of the scene, as a browser would be sent it."""
    with socket.create_connection((HERE, port), timeout=10) as reached:
        uri = f"ws://{host or f'{HERE}:{port}'}/"
        with connect(uri, sock=reached, origin=origin, subprotocols=[PROTOCOL], compression=None) as client:
            return client.recv(timeout=10)


def status(port, host, **headers):
    connection = http.client.HTTPConnection(HERE, port, timeout=10)
    connection.putrequest("GET", "/", skip_host=True)
    for name, value in {"Host": host, **headers}.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse().status


def refused(port, **options):
    with pytest.raises(InvalidStatus) as caught:
        received(port, **options)
    return caught.value.response.status_code == 403


def test_its_own_page_receives_the_scene_and_so_does_a_program(port):
    for name in (HERE, "localhost"):
        assert received(port, host=f"{name}:{port}", origin=f"http://{name}:{port}")
        assert status(port, f"{name}:{port}") == 200
    assert received(port)


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "https://127.0.0.1", "null", "http://127.0.0.1:1", "http://localhost", "file://", ""],
)
def test_a_page_of_another_origin_is_refused(port, origin):
    assert refused(port, origin=origin)
    assert status(port, f"{HERE}:{port}", Origin=origin) == 403


def test_a_name_that_was_made_to_point_here_is_refused_though_origin_and_host_agree(port):
    rebound = f"evil.example:{port}"
    assert refused(port, host=rebound, origin=f"http://{rebound}")
    assert status(port, rebound) == 403
    for host in (f"localhost.evil.example:{port}", f"{HERE}.evil.example", f"192.0.2.7:{port}", "[", ""):
        assert status(port, host) == 403
    assert status(port, None) in (400, 403)


def test_two_hosts_are_refused(port):
    connection = http.client.HTTPConnection(HERE, port, timeout=10)
    connection.putrequest("GET", "/", skip_host=True)
    connection.putheader("Host", f"{HERE}:{port}")
    connection.putheader("Host", "evil.example")
    connection.endheaders()
    assert connection.getresponse().status == 403


def test_through_a_tunnel_the_page_has_another_port(port):
    assert received(port, host="localhost:9000", origin="http://localhost:9000")
    assert refused(port, host=f"localhost:{port}", origin="http://localhost:9000")


def test_what_is_served_to_a_network_is_found_by_every_number_and_by_the_names_of_the_machine(monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "Box.lan")
    served = Served.by("0.0.0.0", ["0.0.0.0"])
    for name in ("192.0.2.7", "[2001:db8::1]", "localhost", "box.lan", "BOX", "box.local", HERE):
        assert served.admits([f"{name}:8080"], [f"http://{name}:8080"])
    assert not served.admits(["evil.example:8080"], ["http://evil.example:8080"])
    assert not served.admits(["192.0.2.7:8080"], ["http://192.0.2.8:8080"])


def test_what_is_served_under_a_name_is_found_by_it_and_by_its_address():
    served = Served.by("plants.example", ["192.0.2.7"])
    assert served.admits(["plants.example:80"], [])
    assert served.admits(["192.0.2.7:80"], [])
    assert not served.admits(["localhost:80"], [])
    assert not served.admits(["192.0.2.8:80"], [])


def test_a_server_that_is_started_in_another_way_is_an_error():
    with pytest.raises(RenderingError, match="install viser"), answering_own_page(Served.by(HERE, [HERE])):
        pass
    assert own_page.websockets.asyncio.server.serve.__module__ == "websockets.asyncio.server"
