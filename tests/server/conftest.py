"""A folder of .reel files, and a player's folder that stands for the built one."""

import shutil
import threading

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

import uvicorn
from starlette.testclient import TestClient

from meshreel.server.app import make_app
from meshreel.server.library import Library
from meshreel.server.run import ServerOptions, run
from tests.golden import GOLDEN

ODD = 'a "b" <i> ü#%.reel'


@pytest.fixture
def folder(tmp_path):
    """Two whole files, one in a folder of its own with an odd name, a truncated one, one that is none, and others."""
    made = tmp_path / "videos"
    (made / "sub").mkdir(parents=True)
    shutil.copy(GOLDEN / "layers.reel", made / "walk.reel")
    shutil.copy(GOLDEN / "scene.reel", made / "sub" / ODD)
    whole = (GOLDEN / "scene.reel").read_bytes()
    (made / "cut.reel").write_bytes(whole[: len(whole) - 100])
    (made / "none.reel").write_bytes(b"this is no video at all")
    (made / "secret.txt").write_text("secret", encoding="utf-8")
    (tmp_path / "outside.reel").write_bytes(whole)
    return made


@pytest.fixture
def player(tmp_path):
    """Stands for the built player."""
    made = tmp_path / "player"
    made.mkdir()
    (made / "meshreel-player.js").write_text("export {};\n", encoding="utf-8")
    (made / "core.wasm").write_bytes(b"\0asm")
    (made / "page.css").write_text("body { margin: 0; }\n", encoding="utf-8")
    return made


@pytest.fixture
def client(folder, player):
    """Of the whole folder."""
    return TestClient(make_app(Library(folder), player))


@pytest.fixture
def live(monkeypatch):
    """Serves an application from a thread and gives its address; stopped from within: signals are not for threads."""
    servers: list[uvicorn.Server] = []
    threads: list[threading.Thread] = []
    made = uvicorn.Server.__init__

    def remember(self, *arguments):
        servers.append(self)
        made(self, *arguments)

    def start(app, options=ServerOptions()):
        told: list[str] = []
        heard = threading.Event()

        def tell(found):
            told.extend(found)
            heard.set()

        threads.append(threading.Thread(target=run, args=(app, options, tell)))
        threads[-1].start()
        assert heard.wait(60)
        return told[0]

    start.servers = servers
    monkeypatch.setattr(uvicorn.Server, "__init__", remember)
    yield start
    for server in servers:
        server.should_exit = True
    for thread in threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in threads)
