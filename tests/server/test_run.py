"""Addresses of the server and how it announces them."""

import re
import socket
import ssl
import sys
import threading
import time
import urllib.request
from datetime import timedelta
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit

import pytest
from cryptography import x509
from starlette.testclient import TestClient

from meshreel.cli import one_line
from meshreel.errors import InputError
from meshreel.server.app import make_app
from meshreel.server.heads import MOST_MEMORY, PATIENCE, SHARE
from meshreel.server.library import Library
from meshreel.server.run import IDLE, MOST_CONNECTIONS, ServerOptions, addresses, run

ROOT = Path(__file__).resolve().parents[2]


def test_addresses_are_those_to_type():
    assert addresses(ServerOptions(), 80) == ["http://127.0.0.1:80/"]
    assert addresses(ServerOptions(host="::1", https=True), 4433) == ["https://[::1]:4433/"]
    everywhere = addresses(ServerOptions(host="0.0.0.0"), 81)
    assert everywhere[0] == "http://localhost:81/" and not any("0.0.0.0" in address for address in everywhere)


def test_a_taken_port_and_an_unknown_host_are_reported_with_a_remedy(folder, player):
    app = make_app(Library(folder), player)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"cannot listen on 127.0.0.1:{port}: .*give another --port"):
            run(app, ServerOptions(port=port), lambda _: None)
    with pytest.raises(InputError, match=r"cannot listen on no\.such\.host\.invalid"):
        run(app, ServerOptions(host="no.such.host.invalid"), lambda _: None)
    with pytest.raises(InputError, match="--port 70000"):
        ServerOptions(port=70_000)


def test_https_answers_with_a_certificate_for_this_machines_addresses(folder, player, live):
    address = live(make_app(Library(folder), player), ServerOptions(https=True))
    assert address.startswith("https://127.0.0.1:")
    port = int(address.rstrip("/").rpartition(":")[2])
    trusting = ssl.create_default_context()
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    with urllib.request.urlopen(f"{address}files/walk.reel", context=trusting, timeout=60) as answer:
        assert answer.read() == (folder / "walk.reel").read_bytes()
    made = x509.load_pem_x509_certificate(ssl.get_server_certificate(("127.0.0.1", port)).encode())
    names = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "localhost" in names.get_values_for_type(x509.DNSName)
    assert {"127.0.0.1", "::1"} <= {str(one) for one in names.get_values_for_type(x509.IPAddress)}
    life = made.not_valid_after_utc - made.not_valid_before_utc
    assert timedelta(days=30) < life < timedelta(days=398)  # what browsers accept


def test_https_without_its_library_is_reported_before_any_address_is(folder, player, monkeypatch):
    monkeypatch.setitem(sys.modules, "trustme", None)
    told = []
    with pytest.raises(ModuleNotFoundError) as caught:
        run(make_app(Library(folder), player), ServerOptions(https=True), told.append)
    assert told == [] and "meshreel[play]" in one_line(caught.value)


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this system has no IPv6")
def test_all_addresses_of_version_6_are_all_of_version_4_too(folder, player, live):
    address = live(make_app(Library(folder), player), ServerOptions(host="::"))
    for host in ("127.0.0.1", "[::1]"):
        with urllib.request.urlopen(address.replace("localhost", host), timeout=60) as answer:
            assert answer.status == 200


def test_a_server_for_this_machine_answers_to_local_names_only(folder, player):
    client = TestClient(make_app(Library(folder), player, hosts=ServerOptions().hosts))
    for host, code in (("localhost", 200), ("127.0.0.1:80", 200), ("[::1]:80", 200), ("evil.example", 400), ("", 400)):
        assert client.get("/files/walk.reel", headers={"Host": host}).status_code == code
    assert ServerOptions(host="0.0.0.0").hosts == ServerOptions(host="192.168.0.7").hosts == ("*",)


def test_requests_beyond_the_limit_are_refused_until_connections_end(folder, player, live, monkeypatch):
    monkeypatch.setattr("meshreel.server.run.MOST_CONNECTIONS", 3)
    place = urlsplit(live(make_app(Library(folder), player)))
    lines = [socket.create_connection((place.hostname, place.port)) for _ in range(2)]
    with pytest.raises(HTTPError, match="503"):
        urllib.request.urlopen(place.geturl(), timeout=60)
    for line in lines:
        line.close()
    time.sleep(0.3)
    with urllib.request.urlopen(place.geturl(), timeout=60) as answer:
        assert answer.status == 200


def test_the_limits_are_those_that_the_documentation_states():
    page = (ROOT / "docs/player.md").read_text(encoding="utf-8")
    rows = [line for line in page[page.index("### Limits") :].splitlines() if line.startswith("| ")]
    stated = [[int(number) for number in re.findall(r"\d+", row)] for row in rows[2:]]
    assert stated == [[MOST_CONNECTIONS, 503], [IDLE], [2], [PATIENCE, MOST_MEMORY >> 30], [SHARE]]


def waited_for(condition):
    for _ in range(6000):
        if condition():
            return
        time.sleep(0.01)
    pytest.fail("not within a minute")


def test_clients_that_wait_share_a_gallery_and_those_that_leave_take_no_place(folder, player, live, monkeypatch):
    begun, told, entries = list[int](), threading.Event(), Library.entries

    def slow(self):
        begun.append(1)
        assert told.wait(60)
        return entries(self)

    monkeypatch.setattr(Library, "entries", slow)
    address = live(make_app(Library(folder), player))
    port = urlsplit(address).port
    asking = [socket.create_connection(("127.0.0.1", port), timeout=60) for _ in range(20)]
    for line in asking:
        line.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    tasks = live.servers[0].server_state.tasks
    waited_for(lambda: len(tasks) == 20)
    for line in asking[1:]:
        line.close()
    waited_for(lambda: len(tasks) == 1)
    with urllib.request.urlopen(f"{address}files/walk.reel", timeout=60) as answer:
        assert answer.read() == (folder / "walk.reel").read_bytes()
    told.set()
    assert asking[0].recv(12) == b"HTTP/1.1 200" and len(begun) == 1
    asking[0].close()


def test_a_gallery_that_cannot_be_made_is_an_error_of_its_request_alone(folder, player, monkeypatch):
    client = TestClient(make_app(Library(folder), player), raise_server_exceptions=False)
    with monkeypatch.context() as broken:
        broken.setattr(Library, "entries", lambda _: 1 / 0)
        assert client.get("/").status_code == 500
    assert client.get("/").status_code == 200
