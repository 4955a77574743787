"""Commands whose inputs and outputs are URLs write the bytes that they write on a disk; a failed one writes nothing."""

import functools
import http.server
import threading
from collections import Counter

import fsspec
import pytest

from meshreel.io.write import write_mesh
from tests.cli.conftest import failed
from tests.spheres import sliding_sphere

pytestmark = pytest.mark.usefixtures("quick_presets")
FLAGS = ("--key-interval", "0.2", "--dynamic-only")
FRAMES = 6


class Server(http.server.ThreadingHTTPServer):
    """A web server of a folder, which counts what it is asked for, and lacks or cuts what it is told to."""

    def __init__(self, folder):
        super().__init__(("127.0.0.1", 0), functools.partial(Handler, directory=folder))
        self.asked, self.lacks, self.cuts = Counter[str](), "", ""
        self.url = f"http://127.0.0.1:{self.server_port}"


class Handler(http.server.SimpleHTTPRequestHandler):
    server: Server

    def send_head(self):
        self.server.asked[self.path] += 1
        if self.path == self.server.lacks:
            self.send_error(404)
            return None
        return super().send_head()

    def copyfile(self, source, outputfile):
        outputfile.write(source.read()[: -9 if self.path == self.server.cuts else None])

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    """A folder of a ball that slides, ten frames a second."""
    folder = tmp_path_factory.mktemp("slide") / "ball"
    folder.mkdir()
    for number, mesh in enumerate(sliding_sphere(FRAMES, levels=1)):
        write_mesh(mesh, folder / f"frame {number}.ply")
    (folder / "capture.json").write_text('{"frames_per_second": 10, "up": "z"}')
    return folder


@pytest.fixture
def server(slide):
    """A web server of the ball's folder."""
    with Server(slide.parent) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture
def store(slide):
    """Files in memory, behind memory://; the ball is among them."""
    store = fsspec.filesystem("memory")
    store.put(f"{slide}/", "/ball", recursive=True)
    yield store
    store.rm("/", recursive=True)


@pytest.fixture
def whole(run, slide, tmp_path):
    """The bytes of an encode from a disk to a disk."""
    assert run("encode", slide, "-o", tmp_path / "whole.reel", *FLAGS).code == 0
    return (tmp_path / "whole.reel").read_bytes()


def test_workers_read_from_a_web_server_to_the_same_bytes(run, server, whole, tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.cli.workers._Workers.worth", 0)  # frames: processes pay at once
    said = run("encode", f"{server.url}/ball", "-o", tmp_path / "a.reel", *FLAGS, "--jobs", "2")
    assert said.code == 0 and (tmp_path / "a.reel").read_bytes() == whole
    frames = {path: count for path, count in server.asked.items() if path.endswith(".ply")}
    assert len(frames) == FRAMES and set(frames.values()) == {3}  # survey, encode, and first view


def test_parts_by_url_join_to_the_same_bytes(run, store, whole):
    assert run("survey", "memory://ball", "-o", "memory://out/s.json").code == 0
    parts = [f"memory://out/{k}.reel" for k in (1, 2)]
    for k, part in enumerate(parts, 1):
        given = ("--survey", "memory://out/s.json", "--part", f"{k}/2")
        assert run("encode", "memory://ball/*.ply", "--fps", "10", "--up", "z", "-o", part, *FLAGS, *given).code == 0
    row = run("concat", *parts, "-o", "memory://out/a.reel", "--json").row
    assert store.cat("/out/a.reel") == whole and row["output"] == "memory://out/a.reel" and row["bytes"] == len(whole)
    assert failed(run("concat", *parts, "-o", parts[0]), "memory://out/1.reel: is the input")
    assert failed(run("concat", "memory://no.reel", "-o", "memory://b.reel"), "memory://no.reel: cannot be read")
    store.pipe("/bad.reel", whole[:-1] + b"?")
    assert failed(run("concat", "memory://bad.reel", "-o", "memory://b.reel"), "memory://bad.reel: chunk", "damaged")
    assert not store.exists("/b.reel")


def test_a_search_for_a_rate_uploads_what_it_found(run, store):
    row = run("encode", "memory://ball", "-o", "memory://a.reel", *FLAGS, "--target-psnr", "83", "--json").row
    assert row["output"] == "memory://a.reel" and store.size("/a.reel") == row["bytes"]


@pytest.mark.parametrize(
    ("fault", "words"), [("lacks", ["the server answers 404"]), ("cuts", ["bytes came", "check the path"])]
)
def test_half_a_folder_is_an_error_that_names_the_frame_and_nothing_is_written(run, server, store, fault, words):
    setattr(server, fault, "/ball/frame%204.ply")
    said = run("encode", f"{server.url}/ball", "-o", "memory://a.reel", *FLAGS)
    assert failed(said, f"frame 4 ({server.url}/ball/frame%204.ply): cannot be read", *words)
    assert not store.exists("/a.reel")


def test_a_server_that_is_not_there_is_an_error(run, server, tmp_path):
    server.server_close()
    assert failed(run("encode", f"{server.url}/ball", "-o", tmp_path / "a.reel"), f"{server.url}/ball: cannot be read")


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize(
    ("command", "output", "words"),
    [
        ("encode", "memory://a.ply", ["must end in .reel"]),
        ("concat", "memory://a.ply", ["must end in .reel"]),
        ("survey", "memory://a.ply", ["must end in .json"]),
        ("encode", "http://127.0.0.1:9/a.reel", ["a web server takes no output"]),
        ("encode", "moon://a.reel", ["Protocol not known: moon"]),
    ],
)
def test_outputs_that_cannot_be_are_refused(run, command, output, words):
    assert failed(run(command, "memory://ball", "-o", output), output, *words)
