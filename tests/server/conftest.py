"""A folder of .reel files, and a player's folder that stands for the built one."""

import shutil
import struct
import threading
import zlib

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

import uvicorn
from starlette.testclient import TestClient

from meshreel.server.app import make_app
from meshreel.server.library import Library
from meshreel.server.run import ServerOptions, run
from tests.golden import GOLDEN

ODD = 'a "b" <i> ü#%.reel'


def with_long_head(file, mib):
    """Write a legal file of one empty frame whose head has so many MiB of chunks of an unknown kind."""
    golden = (GOLDEN / "layers.reel").read_bytes()

    def entry(kind, form, frames, size, crc):
        return struct.pack("<BBHBBHBI", kind, form, frames, 0, 0, 1, size, crc)

    group, other = entry(2, 4, 1, 1, zlib.crc32(b"\4")), entry(200, 1, 0, 1, 0)
    count = int((mib * 2**20 - 200) // len(other))
    body = golden[14:78] + struct.pack("<H2sqBI", 2, b"{}", 0, 0, count + 1) + group + count * other
    head = golden[:9] + bytes([0]) + struct.pack("<I", len(body) + 18) + body
    file.write_bytes(head + struct.pack("<I", zlib.crc32(head)) + b"\4" + bytes(count))


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
