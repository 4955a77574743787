"""Keys in URLs reach nothing that is printed, raised, logged or written."""

import functools
import gc
import http.server
import logging
import pickle
import shutil
import threading
import time
import traceback

import fsspec
import pytest

import meshreel
from meshreel.errors import InputError, without_secret
from meshreel.io.files import Remote, located
from tests.golden import GOLDEN

SECRET = "PaSSw0rd"
WORDS = (SECRET, SECRET.lower(), "dXNlcjpQYVNTdzByZA")  # also as headers have it
DOORS = ("http://user:PaSSw0rd@{}", "http://PaSSw0rd@{}", "http://{}?X-Amz-Signature=PaSSw0rd", "http://{}#t=PaSSw0rd")
BROKEN = ("http://[{}?s=PaSSw0rd", "http://{}/a b.reel?s=PaSSw0rd", "http://u:PaSSw0rd@no.such.host.invalid/{}")
BROKEN += ("http://user:PaSSw0rd@127.0.0.1:port/{}", "http://127.0.0.1:1/{}?s=PaSSw0rd", "moon://u:PaSSw0rd@{}")
BROKEN += ("s3://KEY:PaSS/PaSSw0rd@bucket/{}", "memory://{}?versionId=PaSSw0rd")


class Handler(http.server.SimpleHTTPRequestHandler):
    """Sends files to whoever asks, but nothing of /refused."""

    def send_head(self):
        if "refused" in self.path:
            self.send_error(403, f"{self.path} is refused to {self.headers.get('Authorization')}")
            return None
        if "elsewhere" in self.path:
            self.send_response(302)
            self.send_header("Location", f"gopher://a/{self.path}")
            self.end_headers()
            return None
        return super().send_head()

    def log_message(self, *_):
        pass


@pytest.fixture
def place(tmp_path):
    """A web server of conformance files and of a folder of frames: its address and path, without the scheme."""
    shutil.copy(GOLDEN / "layers.reel", tmp_path / "a.reel")
    (tmp_path / "none.reel").write_bytes(b"this is no video")
    (tmp_path / "long.reel").write_bytes((GOLDEN / "layers.reel").read_bytes()[:-9])
    made = functools.partial(Handler, directory=tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), made) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield f"127.0.0.1:{server.server_port}"
        server.shutdown()


def found(text):
    return [word for word in WORDS if word in str(text)]


def texts_of(error):
    """All that a traceback prints, with the locals of no frame."""
    chain = []
    while error is not None:
        chain += [str(error), repr(error), *map(str, getattr(error, "__notes__", []))]
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return "\n".join(chain)


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("name", ["a.reel", "none.reel", "long.reel", "refused.reel", "elsewhere.reel", "gone.reel"])
def test_keys_of_a_web_address_are_in_nothing_of_a_video(place, door, name, caplog):
    url = door.format(f"{place}/{name}")
    caplog.set_level(logging.DEBUG)
    try:
        with meshreel.open(url) as video:
            list(video)
            assert not found([repr(video), video._repr_html_(), video._page(), video.name, vars(video.reader)])
            video.reader.source._url = url.replace(name, "gone.reel")
            video.reader.source._begin = b""
            video.reader.source.get_bytes(0, 9)
    except meshreel.errors.MeshreelError as error:
        assert not found(texts_of(error) + "".join(traceback.format_exception(error))), error
        assert not found(pickle.loads(pickle.dumps(error)))
    else:
        pytest.fail("nothing failed")
    assert not found(caplog.text)
    gc.collect()


@pytest.mark.parametrize("door", BROKEN)
def test_keys_of_an_address_that_leads_nowhere_are_in_no_error(place, door):
    url = door.format(f"{place}/a.reel")
    for act in (meshreel.open, lambda url: meshreel.encode(url, "a.reel"), lambda url: Remote(url).read(9)):
        with pytest.raises((InputError, OSError, ImportError)) as caught:
            act(url)
        assert not found(texts_of(caught.value)), caught.value
    assert not found([Remote(url), str(Remote(url))])


COMMANDS = ["tag {} title=x -o {out}/x.reel", "cut {} 0:2 -o {out}/x.reel", "concat {} {} -o {out}/x.reel"]
COMMANDS += ["info {}", "decode {} -o {out}/x", "export {} -o {out}/x.glb", "encode {} -o {out}/x.reel"]
COMMANDS += ["survey {} -o {out}/x.json", "compare {} {}", "retime {} --fps 9 -o {out}/x.reel", "play {}"]


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("command", COMMANDS)
def test_keys_are_in_nothing_that_a_command_prints_or_writes(run, place, door, command, tmp_path_factory, caplog):
    out = tmp_path_factory.mktemp("out")
    for name in ("a.reel", "none.reel", "long.reel", "refused.reel"):
        url = door.format(f"{place}/{name}")
        said = run(*(part.format(url, url, out=out) for part in command.split()), "--json")
        assert not found([said.out, said.err]), said
        assert not any(found(path.read_bytes()) for path in out.rglob("*") if path.is_file())
    assert not found(caplog.text)


def test_a_store_that_names_its_keys_in_errors_is_not_quoted(monkeypatch):
    def refuses(_, path, **__):
        raise RuntimeError(f"403 for {path} with {SECRET}, https://store/{path}?sig={SECRET}")

    store = fsspec.filesystem("memory")
    store.pipe(f"/b/a.reel?key={SECRET}", b"x")
    monkeypatch.setattr(type(store), "cat_file", refuses)
    with pytest.raises(InputError, match=r"^memory://b/a\.reel\?\.\.\.: cannot be read \(RuntimeError\)") as caught:
        meshreel.open(f"memory://b/a.reel?key={SECRET}")
    assert not found(texts_of(caught.value))


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("https://a/b.reel", "https://a/b.reel"),
        ("https://u:p@a:80/b.reel?k=v&w=x#f", "https://a:80/b.reel?..."),
        ("https://u:p@ss@a/b", "https://a/b"),
        ("s3://KEY:a/b+c@bucket/b.reel", "s3://bucket/b.reel"),
        ("http://a:80/@b/c", "http://a:80/@b/c"),
        ("simplecache::s3://k:v@b/c?d", "simplecache::s3://b/c?..."),
        (
            "x: cannot be read (https://a/b?k=v); check https://u@c/d?e#f: it",
            "x: cannot be read (https://a/b?...); check https://c/d?...: it",
        ),
        ("http:/u:p@a/b?k=v: no such file", "http:/a/b?...: no such file"),
        ("http://a/b c d?k=v e", "http://a/b c d?... e"),
        ("C:/a#b/c?d@e.ply", "C:/a#b/c?d@e.ply"),
        ("C#/a?b@c.ply", "C#/a?b@c.ply"),
    ],
)
def test_messages_have_addresses_without_keys(url, shown):
    assert without_secret(url) == without_secret(shown) == str(InputError(url)) == shown
    if "://" in url and " " not in url and "::" not in url:
        assert str(located(url)) == shown


@pytest.mark.parametrize("text", ["ab:/" * 25_000, "http://h/?" + ":" * 100_000 + "x", "ab:/ " * 20_000])
def test_a_long_message_takes_no_time(text):
    begin = time.process_time()
    assert len(str(InputError(text))) < 5000
    assert time.process_time() - begin < 5
