"""Where the server listens, and what it tells of that."""

from __future__ import annotations

import socket
import ssl
import threading
import urllib.request

import pytest

from meshreel.errors import InputError
from meshreel.server.app import make_app
from meshreel.server.library import Library
from meshreel.server.run import ServerOptions, addresses, run


def test_addresses_are_those_to_type():
    assert addresses(ServerOptions(), 80) == ["http://127.0.0.1:80/"]
    assert addresses(ServerOptions(host="::1", https=True), 4433) == ["https://[::1]:4433/"]
    everywhere = addresses(ServerOptions(host="0.0.0.0"), 81)
    assert everywhere[0] == "http://localhost:81/" and not any("0.0.0.0" in address for address in everywhere)


def test_a_taken_port_and_an_unknown_host_are_told_with_a_remedy(folder, player):
    app = make_app(Library(folder), player)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"cannot listen on 127.0.0.1:{port}: .*give another --port"):
            run(app, ServerOptions(port=port), lambda _: None)
    with pytest.raises(InputError, match=r"cannot listen on no\.such\.host\.invalid"):
        run(app, ServerOptions(host="no.such.host.invalid"), lambda _: None)
    with pytest.raises(InputError, match="--port 70000"):
        ServerOptions(port=70_000)


def test_https_answers_with_a_certificate_of_its_own(folder, player, monkeypatch):
    """The server is stopped from within: signals are for the main thread, and tested with the command."""
    import uvicorn

    servers: list[uvicorn.Server] = []
    made = uvicorn.Server.__init__

    def remember(self, *arguments):
        servers.append(self)
        made(self, *arguments)

    monkeypatch.setattr(uvicorn.Server, "__init__", remember)
    told: list[list[str]] = []
    heard = threading.Event()

    def tell(found):
        told.append(found)
        heard.set()

    work = threading.Thread(target=run, args=(make_app(Library(folder), player), ServerOptions(https=True), tell))
    work.start()
    try:
        assert heard.wait(60)
        trusting = ssl.create_default_context()
        trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
        [address] = told[0]
        assert address.startswith("https://127.0.0.1:")
        with urllib.request.urlopen(f"{address}files/walk.reel", context=trusting, timeout=60) as answer:
            assert answer.read() == (folder / "walk.reel").read_bytes()
    finally:
        servers[0].should_exit = True
        work.join(60)
    assert not work.is_alive()
