"""An encode that was stopped continues, to the bytes of one that was not; what does not belong to it is refused."""

from __future__ import annotations

import hashlib
import json
import shutil
import struct
import sys
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import fsspec
import pytest

from meshreel.encoder.group import digests
from meshreel.encoder.group.forms import EncodedGroup
from meshreel.encoder.group.target import Fidelity
from meshreel.encoder.rate_control import Goal, encode_to
from meshreel.encoder.run import journal as module
from meshreel.encoder.run import schedule as recipe
from meshreel.encoder.run.journal import MAGIC, Journal
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry import derived_sequences
from meshreel.types import Mesh, MeshList
from tests.small_options import quick
from tests.small_scene import scene
from tests.spheres import sliding_sphere

BALLS = MeshList(tuple(sliding_sphere(7, levels=1)), 10.0)
EACH_ALONE = replace(quick(key_interval=0.1), scene=None)  # seven intervals


class Stopped(BaseException):
    """What ends an encode in the middle, as Ctrl-C does."""


class Fake:
    """An encoder of intervals whose payloads depend on the frames alone; it stops at the call `stop`."""

    def __init__(self, stop=None):
        self.calls, self.stop = 0, stop

    def __call__(self, interval, *_):
        self.calls += 1
        if self.calls == self.stop:
            raise Stopped
        for number, frame in enumerate(interval.frames):
            payload = bytes([Form.DRACO]) + hashlib.sha256(frame.vertices.tobytes()).digest() * (1 + number)
            yield EncodedGroup(Form.DRACO, 1, payload, (5, len(payload)), Fidelity(0.1, 2.0, 0.3, 60.1))


@pytest.fixture
def fake(monkeypatch):
    """Replaces the encoding of an interval; returns the replacement."""

    def use(stop=None):
        one = Fake(stop)
        monkeypatch.setattr(recipe, "encode_interval", one)
        return one

    return use


def encode(path, resume=None, sequence=BALLS, options=EACH_ALONE, executor=None):
    Encoder(sequence, executor).encode(path, options, resume)
    return path.read_bytes()


@pytest.fixture
def stopped(fake, tmp_path):
    """A path at which an encode was stopped when four of seven intervals were done."""
    fake(stop=5)
    with pytest.raises(Stopped):
        encode(tmp_path / "a.reel")
    fake()
    return tmp_path / "a.reel"


@pytest.mark.parametrize("stop", range(1, 8))
def test_a_stopped_encode_continues_to_the_same_bytes(fake, tmp_path, stop):
    fake()
    whole, path, done = encode(tmp_path / "whole.reel"), tmp_path / "a.reel", stop - 1
    fake(stop)
    with pytest.raises(Stopped) as told:
        encode(path)
    notes = [f"{path}.part has the {done} intervals that are done: continue with --resume"] if done else None
    assert getattr(told.value, "__notes__", None) == notes
    assert {file.name for file in tmp_path.iterdir()} == {"whole.reel"} | ({"a.reel.part"} if done else set())
    again = fake()
    assert encode(path, resume=True) == whole and again.calls == 7 - done
    assert {file.name for file in tmp_path.iterdir()} == {"a.reel", "whole.reel"}


def test_an_encode_to_a_url_that_is_stopped_leaves_nothing_to_continue(fake, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    fake(stop=5)
    with pytest.raises(Stopped) as told:
        Encoder(BALLS).encode("memory://a.reel", EACH_ALONE)
    assert not hasattr(told.value, "__notes__") and not list(tmp_path.iterdir())
    assert not fsspec.filesystem("memory").exists("/a.reel")
    with pytest.raises(InputError, match=r"^memory://a.reel: only an output on a disk can be continued"):
        Encoder(BALLS).encode("memory://a.reel", EACH_ALONE, resume=True)


def test_a_stopped_encode_of_two_jobs_continues_with_any_number_of_them(fake, tmp_path):
    fake()
    whole, path = encode(tmp_path / "whole.reel"), tmp_path / "a.reel"
    for jobs in (1, 2):
        fake(stop=6)
        with ThreadPoolExecutor(2) as executor, pytest.raises(Stopped):
            encode(path, executor=executor)
        with ThreadPoolExecutor(jobs) as executor:
            again = fake()
            assert encode(path, resume=True, executor=executor) == whole and again.calls < 7


def test_what_could_be_continued_is_refused_unless_it_is_said_what_to_do(stopped, fake):
    with pytest.raises(InputError, match=r"a.reel.part: has 4 intervals .* --resume .* --no-resume"):
        encode(stopped)
    anew = fake()
    encode(stopped, resume=False)
    assert anew.calls == 7


@pytest.mark.parametrize(
    ("sequence", "options", "words"),
    [
        (BALLS, replace(EACH_ALONE, quality=60.0), "quality 50.0, now 60.0"),
        (BALLS, replace(quick("paper", group_size=1), scene=None), 'preset "best", now "paper"'),
        (BALLS, replace(EACH_ALONE, key_interval=0.2), "options.key_interval 0.1, now 0.2"),
        (MeshList(BALLS.meshes[:6], 10.0), EACH_ALONE, "frames 7, now 6"),
        (MeshList(BALLS.meshes, 20.0), replace(EACH_ALONE, key_interval=0.05), "frame_rate 10.0, now 20.0"),
        (MeshList(BALLS.meshes, 10.0, "z"), EACH_ALONE, 'up "y", now "z"'),
        (MeshList((*BALLS.meshes[:6], BALLS.meshes[0]), 10.0), EACH_ALONE, r"surfaces\[6\]"),
    ],
)
def test_another_input_or_option_is_refused_and_named(stopped, sequence, options, words):
    before = (stopped.parent / "a.reel.part").read_bytes()
    with pytest.raises(InputError, match=f"is of another encode: {words}.* start over with --no-resume"):
        encode(stopped, True, sequence, options)
    assert (stopped.parent / "a.reel.part").read_bytes() == before


def test_another_version_of_meshreel_or_of_a_library_is_refused(stopped, monkeypatch):
    monkeypatch.setattr(digests, "version", lambda _: "0.0.7")
    with pytest.raises(InputError, match=r'libraries.numpy ".*", now "0.0.7"'):
        encode(stopped, resume=True)
    monkeypatch.setattr(module, "__version__", "0.0.9")
    with pytest.raises(InputError, match=r'meshreel ".*", now "0.0.9"'):
        encode(stopped, resume=True)


def ends_of(data):
    """The places at which the records of a journal end."""
    found, at = [], len(MAGIC)
    while at < len(data):
        at += 12 + struct.unpack_from("<Q", data, at)[0]
        found.append(at)
    return found


def intervals_in(data, path):
    """How many intervals another run could continue from, if the journal of a path were these bytes."""
    path.with_name("a.reel.part").write_bytes(data)
    try:
        with Journal(path, resume=True) as journal:
            raise Stopped
    except Stopped:
        return journal.continued


def test_a_torn_last_record_is_left_out_at_every_byte(stopped, fake):
    data, whole = (stopped.parent / "a.reel.part").read_bytes(), encode(stopped.parent / "whole.reel")
    *_, begin, end = ends_of(data)
    assert {intervals_in(data[:size], stopped) for size in range(begin, end)} == {3}
    for size in (begin, begin + 5, end - 1):
        intervals_in(data[:size], stopped)
        again = fake()
        assert encode(stopped, resume=True) == whole and again.calls == 4


def test_no_flipped_byte_is_trusted(stopped):
    data, whole = (stopped.parent / "a.reel.part").read_bytes(), encode(stopped.parent / "whole.reel")
    ends = ends_of(data)
    for at in range(len(MAGIC), len(data), 11):
        flipped = data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :]
        try:
            assert intervals_in(flipped, stopped) == max(sum(end <= at for end in ends) - 1, 0)
        except InputError as error:
            assert at < ends[1] and "is damaged at its beginning" in str(error)
            continue
        if at % 499 < 11:
            assert encode(stopped, resume=True) == whole
    with pytest.raises(InputError, match="is no journal"):
        intervals_in(b"?" + data[1:], stopped)


def test_a_journal_whose_first_interval_is_damaged_is_not_overwritten_unasked(stopped):
    data, part = (stopped.parent / "a.reel.part").read_bytes(), stopped.parent / "a.reel.part"
    first, second, *_ = ends_of(data)
    for at in (len(MAGIC) + 9, first - 1, first + 9, second - 1):
        flipped = data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :]
        part.write_bytes(flipped)
        for resume in (None, True):
            with pytest.raises(InputError, match="is damaged at its beginning; start over with --no-resume"):
                encode(stopped, resume)
        assert part.read_bytes() == flipped
    encode(stopped, resume=False)


@pytest.mark.parametrize("size", [0, 7, len(MAGIC), len(MAGIC) + 5])
def test_a_journal_that_was_torn_at_its_beginning_holds_nothing(stopped, size):
    data = (stopped.parent / "a.reel.part").read_bytes()
    (stopped.parent / "a.reel.part").write_bytes(data[:size])
    encode(stopped)  # there is nothing to continue


def test_a_file_that_is_no_journal_is_left_alone(tmp_path, fake):
    fake()
    (tmp_path / "a.reel.part").write_bytes(b"half a download")
    for resume in (None, True, False):
        with pytest.raises(InputError, match=r"a.reel.part: is no journal of an encode.* move it away"):
            encode(tmp_path / "a.reel", resume)
    assert (tmp_path / "a.reel.part").read_bytes() == b"half a download"


@pytest.mark.parametrize("groups", [None, [[9]], [[99, 1, 4, [4], False, None, [0, 0, 0, 0]]], "x"])
def test_a_record_that_no_encoder_wrote_is_refused_whatever_its_sum(stopped, groups):
    part = stopped.parent / "a.reel.part"
    data = part.read_bytes()
    first = len(MAGIC) + 12 + struct.unpack_from("<Q", data, len(MAGIC))[0]
    (size,) = struct.unpack_from("<I", data, first + 12)
    head = json.loads(data[first + 16 : first + 16 + size]) | {"groups": groups}
    text = json.dumps(head).encode()
    body = struct.pack("<I", len(text)) + text
    part.write_bytes(data[:first] + struct.pack("<QI", len(body), zlib.crc32(body)) + body)
    with pytest.raises(InputError, match=r"a.reel.part: the interval of frame 0, track 0, cannot be read"):
        encode(stopped, resume=True)


def test_the_journal_of_a_finished_run_gives_the_file_again(fake, tmp_path, monkeypatch):
    fake()
    path, kept = tmp_path / "a.reel", tmp_path / "kept"
    monkeypatch.setattr(module, "sync_folder", lambda folder: shutil.copy(folder / "a.reel.part", kept))
    whole = encode(path)
    kept.rename(tmp_path / "a.reel.part")
    again = fake()
    assert encode(path, resume=True) == whole and again.calls == 0


def test_a_second_encode_to_one_output_is_refused_and_harms_neither(fake, tmp_path):
    fake()
    path = tmp_path / "a.reel"
    with Journal(path), pytest.raises(InputError, match=r"a.reel: another process is writing it"):
        encode(path)
    encode(path)


def test_a_search_begins_again_and_keeps_nothing(fake, tmp_path):
    path, options_at = tmp_path / "a.reel", lambda _: EACH_ALONE
    with pytest.raises(InputError, match="a search for a target begins again"):
        encode_to(Encoder(BALLS), path, Goal(mbps=1.0), options_at, resume=True)
    fake(stop=5)
    with pytest.raises(Stopped):
        encode_to(Encoder(BALLS), path, Goal(mbps=1.0), options_at)
    assert list(tmp_path.iterdir()) == []


def test_a_frame_that_changes_after_the_survey_is_refused(fake, tmp_path, monkeypatch):
    class Moving(MeshList):
        reads = 0

        def __getitem__(self, index):
            object.__setattr__(self, "reads", self.reads + 1)
            mesh = super().__getitem__(index)
            return Mesh(mesh.vertices + (self.reads > 9), mesh.faces)

    Moving.__slots__ = ()
    monkeypatch.setattr(derived_sequences, "MOST_KEPT", 0)  # so that frames are read again
    fake()
    with pytest.raises(InputError, match=r"frame \d: has changed while it was encoded, or .*; encode again"):
        encode(tmp_path / "a.reel", sequence=Moving(BALLS.meshes, 10.0))


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
def test_a_disk_that_is_full_at_any_byte_leaves_the_old_file_and_what_resume_needs(fake, tmp_path):
    import resource

    fake()
    path, part = tmp_path / "a.reel", tmp_path / "a.reel.part"
    whole, before = encode(path), resource.getrlimit(resource.RLIMIT_FSIZE)
    sizes = set[int]()
    for limit in range(0, 8000, 61):
        path.write_bytes(b"old")
        fake()
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        try:
            encode(path)
            break
        except InputError as error:
            assert "a.reel: cannot be written" in str(error) and "free space" in str(error)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert path.read_bytes() == b"old"
        assert {file.name for file in tmp_path.iterdir()} <= {"a.reel", "a.reel.part"}
        if part.exists():
            sizes.add(part.stat().st_size)
            assert encode(path, resume=True) == whole
    assert path.read_bytes() == whole and len(sizes) > 5 and min(sizes) > 0


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "best"])
def test_a_stopped_scene_continues_to_the_same_bytes(tmp_path, preset, monkeypatch):
    encoder, options = Encoder(scene(4)), replace(quick(preset, group_size=1), key_interval=0.1)
    encoder.encode(tmp_path / "whole.reel", options)
    real, calls = recipe.encode_interval, []

    def stops(*arguments):
        calls.append(1)
        if len(calls) == 4:
            raise Stopped
        return real(*arguments)

    monkeypatch.setattr(recipe, "encode_interval", stops)
    with pytest.raises(Stopped):
        encoder.encode(tmp_path / "a.reel", options)
    summary = encoder.encode(tmp_path / "a.reel", options, resume=True)
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()
    assert summary.continued == 3 and summary.size == (tmp_path / "a.reel").stat().st_size
