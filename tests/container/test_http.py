"""Files behind a URL: whole, by ranges, and where the server fails."""

import io
import sys
import threading
from base64 import b64encode
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

import meshreel
from meshreel.coding.mesh import encode_intra
from meshreel.container.http import UrlSource
from meshreel.container.reader import FIRST_REQUEST
from meshreel.container.writer import ReelWriter
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import Header
from meshreel.io.files import Remote
from tests.golden import GOLDEN, frame_record
from tests.metrics.shapes import sphere

DATA = (GOLDEN / "scene.reel").read_bytes()
HEADER = Header(30.0, (0.0, 0.0, 0.0), 1.0, (-0.5,) * 3, (0.5,) * 3, "{}")


def groups_file(count: int) -> bytes:
    """A file of `count` groups of one frame, each of some kB."""
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for number in range(count):
            writer.add_group(number, 1, encode_intra([sphere(0.4 + 0.01 * number)], 1e-4, 0))
    return file.getvalue()


LARGE = groups_file(8)
LONG = bytes(range(256)) * (FIRST_REQUEST // 64)  # four first requests


class Server(ThreadingHTTPServer):
    """Serves `data` at any path; `ranges` switches answers by range, `asked` has the ranges of all requests."""

    def __init__(self, data: bytes, ranges: bool = True) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.data, self.ranges, self.asked = data, ranges, list[str]()
        self.extra = b""  # behind each range

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/a.reel"


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Server)
        data, asked = self.server.data, self.headers.get("Range", "")
        self.server.asked.append(asked)
        first, last = (int(number) for number in asked.removeprefix("bytes=").split("-"))
        if self.server.ranges:
            part = data[first : last + 1] + self.server.extra
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{len(data)}")
        else:
            part = data
            self.send_response(200)
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, format: str, *args: object) -> None:
        """Keep the test's output clean."""


@pytest.fixture
def serve() -> Iterator[Callable[..., Server]]:
    servers: list[Server] = []

    def start(data: bytes, ranges: bool = True) -> Server:
        server = Server(data, ranges)
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        servers.append(server)
        return server

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize("ranges", [True, False])
def test_a_url_opens_the_same_video_as_the_file(serve, ranges):
    server = serve(DATA, ranges)
    with meshreel.open(server.url) as video:
        assert [frame_record(mesh) for mesh in video] == [frame_record(mesh) for mesh in meshreel.open(DATA)]
    assert server.asked[0] == f"bytes=0-{FIRST_REQUEST - 1}"


def test_the_first_request_has_the_head_and_each_range_behind_it_is_one_request(serve):
    server = serve(LONG)
    source = UrlSource(server.url)
    assert source.size == len(LONG)
    assert source.get_bytes(100, 50) == LONG[100:150] and len(server.asked) == 1
    assert source.get_bytes(FIRST_REQUEST, 1000) == LONG[FIRST_REQUEST : FIRST_REQUEST + 1000]
    assert source.get_bytes(len(LONG) - 5, 100) == LONG[-5:]
    assert server.asked[1:] == [
        f"bytes={FIRST_REQUEST}-{FIRST_REQUEST + 999}",
        f"bytes={len(LONG) - 5}-{len(LONG) - 1}",
    ]


def test_a_server_without_ranges_is_asked_once(serve):
    server = serve(LONG, ranges=False)
    source = UrlSource(server.url)
    assert source.get_bytes(FIRST_REQUEST, 1000) == LONG[FIRST_REQUEST : FIRST_REQUEST + 1000]
    assert len(server.asked) == 1


@pytest.mark.parametrize("ranges", [True, False])
def test_the_bytes_that_came_are_told_those_of_a_seek_among_them(serve, ranges):
    data = LARGE
    with meshreel.open(serve(data, ranges).url) as video:
        head = video.bytes_read
        assert head == (min(FIRST_REQUEST, len(data)) if ranges else len(data))
        last = frame_record(video[-1])
        group = video.reader.groups[-1]
        beyond = group.size if ranges and group.end > FIRST_REQUEST else 0
        assert video.bytes_read == head + beyond
    assert last == frame_record(meshreel.open(data)[-1])


def test_a_store_is_read_by_ranges_and_its_errors_name_the_url():
    system = pytest.importorskip("fsspec").filesystem("memory")
    system.pipe("/reels/a.reel", LARGE)
    with meshreel.open("memory://reels/a.reel") as video:
        assert frame_record(video[-1]) == frame_record(meshreel.open(LARGE)[-1])
        assert 0 < video.bytes_read < len(LARGE) and video.path == "memory://reels/a.reel"
    with pytest.raises(InputError, match=r"memory://reels/b.reel: cannot be read \(FileNotFoundError"):
        meshreel.open("memory://reels/b.reel")
    with pytest.raises(InputError, match=r"nowhere://b.reel: cannot be read \(ValueError: Protocol not known"):
        meshreel.open("nowhere://b.reel")


def test_a_store_without_fsspec_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(InputError, match=r"pip install 'meshreel\[remote\]'"):
        meshreel.open("s3://bucket/a.reel")


def test_a_server_that_stops_answering_by_range_is_an_input_error(serve):
    server = serve(LONG)
    source = UrlSource(server.url)
    server.ranges = False
    with pytest.raises(InputError, match=f"without bytes {FIRST_REQUEST}"):
        source.get_bytes(FIRST_REQUEST, 10)


def test_a_server_that_sends_more_than_the_range_is_an_input_error(serve):
    server = serve(LONG)
    source = UrlSource(server.url)
    server.extra = b"more"
    with pytest.raises(InputError, match="11 of 10 bytes came"):
        source.get_bytes(FIRST_REQUEST, 10)


def test_a_url_of_another_file_or_without_a_server_names_the_url(serve):
    with pytest.raises(FormatError, match=r"http://127.0.0.1:\d+/a.reel: not a \.reel file"):
        meshreel.open(serve(LONG).url)
    with pytest.raises(InputError, match=r"http://\[: cannot be read"):
        meshreel.open("http://[")
    with pytest.raises(InputError, match=r"127.0.0.1:1/a\.reel: cannot be read .*; check the address"):
        meshreel.open("http://127.0.0.1:1/a.reel")


def test_an_answer_without_end_is_given_up_at_its_bytes(serve, monkeypatch):
    monkeypatch.setattr("meshreel.web.MOST", 100_000)
    with pytest.raises(InputError, match=r"sends the whole file, of more than 100000 bytes; copy it here"):
        UrlSource(serve(LONG + bytes(100_000), ranges=False).url)


def test_an_answer_that_drips_is_given_up_in_time(serve, monkeypatch):
    monkeypatch.setattr("meshreel.web._PATIENCE", 0.05)

    def drip(self: Handler) -> None:
        self.send_response(206)
        self.send_header("Content-Range", "bytes 0-99/100")
        self.send_header("Content-Length", "100")
        self.end_headers()
        for _ in range(100):
            self.wfile.write(b"x")
            self.wfile.flush()
            threading.Event().wait(0.02)

    monkeypatch.setattr(Handler, "do_GET", drip)
    with pytest.raises(InputError, match=r"cannot be read \(\d+ bytes in .* s are too slow\)"):
        UrlSource(serve(LONG).url)


def test_headers_that_drip_are_given_up_in_time(serve, monkeypatch):
    ended = threading.Event()
    monkeypatch.setattr("meshreel.web.LONGEST", 0.2)
    monkeypatch.setattr(Handler, "do_GET", lambda _: ended.wait(60))
    with pytest.raises(InputError, match=r"cannot be read \(TimeoutError\)"):
        UrlSource(serve(LONG).url)
    ended.set()


def test_a_store_that_hangs_is_given_up_in_time(monkeypatch):
    system, ended = pytest.importorskip("fsspec").filesystem("memory"), threading.Event()
    system.pipe("/reels/a.reel", LARGE)
    monkeypatch.setattr("meshreel.web.LONGEST", 0.2)
    monkeypatch.setattr(type(system), "cat_file", lambda *_, **__: ended.wait(60))
    for act in (lambda: meshreel.open("memory://reels/a.reel"), lambda: Remote("memory://reels/a.reel").read(9)):
        with pytest.raises((InputError, OSError), match="TimeoutError"):
            act()
    ended.set()


def test_a_store_that_sends_more_than_the_range_is_an_input_error(monkeypatch):
    system = pytest.importorskip("fsspec").filesystem("memory")
    system.pipe("/reels/a.reel", LARGE)
    monkeypatch.setattr(type(system), "cat_file", lambda *_, **__: LARGE + b"more")
    with pytest.raises(InputError, match=r"memory://reels/a.reel: cannot be read \(\d+ of \d+ bytes came"):
        meshreel.open("memory://reels/a.reel")


def test_half_an_answer_is_an_input_error(serve, monkeypatch):
    server = serve(LONG, ranges=False)

    def half(self: Handler) -> None:
        self.send_response(200)
        self.send_header("Content-Length", "100")
        self.end_headers()
        self.wfile.write(bytes(50))

    monkeypatch.setattr(Handler, "do_GET", half)
    with pytest.raises(InputError, match="50 of 100 bytes came; open it again"):
        UrlSource(server.url)


def test_a_user_in_an_address_is_sent_as_a_header(serve, monkeypatch):
    asked, do_get = list[str](), Handler.do_GET
    monkeypatch.setattr(Handler, "do_GET", lambda self: asked.append(self.headers["Authorization"]) or do_get(self))
    UrlSource(serve(LONG).url.replace("://", "://us%20er:w@rd@"))
    assert asked == ["Basic " + b64encode(b"us er:w@rd").decode()]
