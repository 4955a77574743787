"""An encode that was stopped continues, to the bytes of one that was not; what does not belong to it is refused."""

import errno
import hashlib
import json
import os
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import fsspec
import pytest

import meshreel
from meshreel.analysis.survey import survey_sequence
from meshreel.capture.recording import open_recording
from meshreel.container.reader import ReelReader
from meshreel.container.sources import FileSource
from meshreel.container.writer import ReelWriter
from meshreel.encoder import sequence as sequence_module
from meshreel.encoder.group import digests
from meshreel.encoder.group.forms import EncodedGroup, Fidelity
from meshreel.encoder.rate_control import Goal, encode_to
from meshreel.encoder.run import interval_files as module
from meshreel.encoder.run import schedule as recipe
from meshreel.encoder.run import surveying
from meshreel.encoder.run.interval_files import IntervalFiles
from meshreel.encoder.scene.parts import take_apart
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry import derived_sequences
from meshreel.io import write
from meshreel.types import Mesh, MeshList
from tests.capture.depth_scenes import camera, record
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
    Encoder(sequence, executor, jobs=1).encode(path, options, resume)
    return path.read_bytes()


def interval(number):
    """The name of the file of an interval of one frame."""
    return f"{number:08}-000.reel"


def names_in(path):
    """The files in the folder of an output."""
    folder = path.with_name(f"{path.name}.part")
    return sorted(file.name for file in folder.iterdir()) if folder.is_dir() else []


def kept(path):
    """What another run could continue from: the files in the folder of an output, by name."""
    return {name: (path.with_name(f"{path.name}.part") / name).read_bytes() for name in names_in(path)}


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
    assert names_in(path) == ([interval(k) for k in range(done)] + ["whole.json"] if done else [])
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
    with pytest.raises(InputError, match=r"a.reel.part: has the 4 intervals .* --resume .* --no-resume"):
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
    before = kept(stopped)
    with pytest.raises(InputError, match=f"is of another encode: {words}.* start over with --no-resume"):
        encode(stopped, True, sequence, options)
    assert kept(stopped) == before


def test_another_version_of_meshreel_or_of_a_library_is_refused(stopped, monkeypatch):
    monkeypatch.setattr(digests, "version", lambda _: "0.0.7")
    with pytest.raises(InputError, match=r'libraries.numpy ".*", now "0.0.7"'):
        encode(stopped, resume=True)
    monkeypatch.setattr(module, "__version__", "0.0.9")
    with pytest.raises(InputError, match=r'meshreel ".*", now "0.0.9"'):
        encode(stopped, resume=True)


@pytest.mark.parametrize("damage", ["torn", "flipped", "longer", "empty", "gone"])
def test_no_damaged_interval_is_trusted_and_the_others_are_not_encoded_again(stopped, fake, damage):
    """At each byte, or each eleventh, whatever the file of the third interval lost."""
    whole, path = encode(stopped.parent / "whole.reel"), stopped.parent / "a.reel.part" / interval(2)
    before, data = kept(stopped), path.read_bytes()
    shapes = {
        "torn": [data[:size] for size in range(1, len(data), 29)],
        "flipped": [data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :] for at in range(0, len(data), 29)],
        "longer": [data + b"?"],
        "empty": [b""],
        "gone": [None],
    }
    for shape in shapes[damage]:
        stopped.with_name("a.reel.part").mkdir(exist_ok=True)
        for name, known in before.items():
            (path.parent / name).write_bytes(known)
        path.unlink() if shape is None else path.write_bytes(shape)
        again = fake()
        assert encode(stopped, resume=True) == whole and again.calls == 4
        assert not path.parent.exists()


def test_an_interval_of_another_encode_or_of_other_frames_is_not_trusted(stopped, fake):
    folder = stopped.parent / "a.reel.part"
    whole = encode(stopped.parent / "whole.reel")
    fake(stop=5)
    with pytest.raises(Stopped):
        encode(stopped.parent / "b.reel", options=replace(EACH_ALONE, quality=60.0))
    shutil.copy(stopped.parent / "b.reel.part" / interval(1), folder / interval(1))
    again = fake()
    assert encode(stopped, resume=True) == whole and again.calls == 4
    fake(stop=5)
    with pytest.raises(Stopped):
        encode(stopped)
    shutil.copy(folder / interval(3), folder / interval(1))
    with pytest.raises(InputError, match=r"00000001-000.reel: the interval of frame 1, .*another surface") as told:
        encode(stopped, resume=True)
    assert not hasattr(told.value, "__notes__")  # which would say that --resume goes on


@pytest.mark.parametrize(
    "change", [{"groups": None}, {"groups": []}, {"groups": [[9]]}, {"interval": 3}, {"encode": 7}]
)
def test_metadata_that_no_encoder_wrote_are_not_trusted_whatever_their_sums(stopped, fake, change):
    path = stopped.parent / "a.reel.part" / interval(0)
    whole = encode(stopped.parent / "whole.reel")
    with FileSource(path) as source:
        reader = ReelReader(source)
        header, payload, layers = reader.header, reader.read_chunk(0), reader.chunks[0].layers
    with ReelWriter(path, replace(header, metadata=json.dumps(reader.metadata | change))) as writer:
        writer.add_group(0, 1, payload, [layers[0].size, len(payload)])
    again = fake()
    if "interval" in change:
        with pytest.raises(InputError, match="is of another surface"):
            encode(stopped, resume=True)
        return
    assert encode(stopped, resume=True) == whole and again.calls == 4


def test_what_tells_of_the_whole_is_not_overwritten_unasked_where_it_is_damaged(stopped):
    path = stopped.parent / "a.reel.part" / "whole.json"
    data = path.read_bytes()
    flips = [data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :] for at in range(0, len(data), 97)]
    for damaged in (*flips, data[:-1], data[: len(data) // 2], b"", b"[]", b"{}", b'{"digest": null}', None):
        path.unlink() if damaged is None else path.write_bytes(damaged)
        for resume in (None, True):
            with pytest.raises(InputError, match=r"whole.json: is damaged, or missing.* start over with --no-resume"):
                encode(stopped, resume)
        assert (path.read_bytes() if path.exists() else None) == damaged
    encode(stopped, resume=False)
    assert not path.parent.exists()


@pytest.mark.parametrize("left", [[], ["lock"], ["whole.json"], [".whole.json", ".00000000-000.reel"], [".scene.npz"]])
def test_a_folder_in_which_nothing_is_done_holds_nothing(stopped, left):
    folder = stopped.parent / "a.reel.part"
    data = (folder / "whole.json").read_bytes()
    for name in names_in(stopped):
        (folder / name).unlink()
    for name in left:
        (folder / name).write_bytes(data[: 9 if name.startswith(".") else None])
    encode(stopped)  # there is nothing to continue
    assert not folder.exists()


@pytest.mark.parametrize("is_folder", [False, True])
def test_what_no_encode_of_this_version_wrote_is_left_alone(tmp_path, fake, is_folder):
    """A file, as versions before kept under this name, too."""
    fake()
    theirs = tmp_path / "a.reel.part" / "notes.txt" if is_folder else tmp_path / "a.reel.part"
    theirs.parent.mkdir(exist_ok=True)
    theirs.write_bytes(b"meshreel journal 2\n")
    for resume in (None, True, False):
        with pytest.raises(InputError, match=r"a.reel.part: is no folder of an encode.* move it away"):
            encode(tmp_path / "a.reel", resume)
    assert theirs.read_bytes() == b"meshreel journal 2\n" and names_in(tmp_path / "a.reel") == ["notes.txt"] * is_folder


def test_foreign_files_in_a_folder_of_an_encode_stay(stopped):
    theirs = stopped.parent / "a.reel.part" / "notes.txt"
    theirs.write_bytes(b"mine")
    encode(stopped, resume=True)
    assert names_in(stopped) == ["notes.txt"] and theirs.read_bytes() == b"mine"


def test_a_link_to_a_folder_is_not_written_through(tmp_path, fake):
    fake()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "a.reel.part").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"a.reel.part: is no folder of an encode.* move it away"):
        encode(tmp_path / "a.reel")
    assert not list((tmp_path / "elsewhere").iterdir())


def test_the_files_of_intervals_decode_and_say_of_what_they_are(tmp_path):
    """Each by itself, in its place: the files of an encode that runs, or was stopped, can be looked at."""
    seen = dict[str, tuple[int, float]]()

    def look(*_):
        for path in (tmp_path / "a.reel.part").glob("[!.]*.reel"):  # a hidden one is being written
            with meshreel.open(path) as video:
                seen[path.name] = len(video), float(video[0].vertices[:, 0].mean())

    Encoder(BALLS, progress=look).encode(tmp_path / "a.reel", replace(quick(key_interval=0.3), scene=None))
    assert len(seen) >= 2 and all(count <= 3 for count, _ in seen.values())
    for name, (_, middle) in seen.items():
        assert middle == pytest.approx(BALLS[int(name[:8])].vertices[:, 0].mean(), abs=0.05)


def test_an_interval_of_more_groups_than_metadata_have_room_for_continues_too(fake, tmp_path):
    balls = MeshList(tuple(sliding_sphere(1, levels=1)) * 1600, 10.0)
    options = replace(quick(key_interval=100.0), scene=None)  # intervals of 800 groups
    fake()
    whole = encode(tmp_path / "whole.reel", None, balls, options)
    fake(stop=2)
    with pytest.raises(Stopped):
        encode(tmp_path / "a.reel", None, balls, options)
    assert encode(tmp_path / "a.reel", True, balls, options) == whole


def test_the_files_of_a_finished_run_give_the_output_again(fake, tmp_path, monkeypatch):
    fake()
    path, copy = tmp_path / "a.reel", tmp_path / "copy"
    monkeypatch.setattr(IntervalFiles, "_clear", lambda files: shutil.copytree(files.path, copy, dirs_exist_ok=True))
    whole = encode(path)
    monkeypatch.undo()
    shutil.rmtree(tmp_path / "a.reel.part")
    copy.rename(tmp_path / "a.reel.part")
    again = fake()
    assert encode(path, resume=True) == whole and again.calls == 0


def test_finished_intervals_hold_no_payloads(fake, tmp_path, monkeypatch):
    kept_groups, real = list[EncodedGroup](), IntervalFiles.keep
    monkeypatch.setattr(IntervalFiles, "keep", lambda *given: kept_groups.extend(found := real(*given)) or found)
    fake()
    encode(tmp_path / "a.reel")
    assert len(kept_groups) == 7 and not any(group.payload for group in kept_groups)


def test_a_second_encode_to_one_output_is_refused_and_harms_neither(fake, tmp_path):
    fake()
    path = tmp_path / "a.reel"
    with IntervalFiles(path), pytest.raises(InputError, match=r"a.reel: another process is writing it"):
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


def test_what_a_killed_search_left_is_in_the_way_of_nobody(fake, tmp_path, monkeypatch):
    path, left = tmp_path / "a.reel", dict[str, bytes]()
    fake()
    whole, real = encode(path), Fake.__call__

    def killed(self, *arguments):
        left.update(kept(path) if self.calls == 4 else {})
        yield from real(self, *arguments)

    monkeypatch.setattr(Fake, "__call__", killed)
    goal = Goal(mbps=8 * len(whole) / 0.7 / 1e6)  # of seven frames at 10 a second
    fake()
    encode_to(Encoder(BALLS), path, goal, lambda _: EACH_ALONE)
    assert len(left) > 3
    for again in (lambda: encode_to(Encoder(BALLS), path, goal, lambda _: EACH_ALONE), lambda: encode(path)):
        path.with_name("a.reel.part").mkdir()
        for name, data in left.items():
            (tmp_path / "a.reel.part" / name).write_bytes(data)
        again()
        assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == whole


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_in_place_of_what_tells_of_the_whole_does_not_stop_the_encode(stopped):
    path = stopped.parent / "a.reel.part" / "whole.json"
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"a.reel: cannot be written .*pipe"):
        encode(stopped, resume=True)


def test_a_folder_that_is_no_encodes_keeps_a_file_called_lock(tmp_path, fake):
    fake()
    folder = tmp_path / "a.reel.part"
    folder.mkdir()
    (folder / "lock").write_text("mine")
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"for it holds notes.txt"):
        encode(tmp_path / "a.reel")
    assert (folder / "lock").read_text() == "mine"


def test_an_error_of_an_output_names_the_file_in_its_way(stopped):
    (stopped.parent / "a.reel.part" / f".{interval(4)}").mkdir()
    with pytest.raises(InputError, match=rf"a.reel: cannot be written \(.* at .*\.{interval(4)}\)"):
        encode(stopped, resume=True)


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


def test_a_disk_that_is_full_at_any_file_leaves_the_old_output_and_what_resume_needs(fake, tmp_path, monkeypatch):
    path, real, left = tmp_path / "a.reel", write.sync, set[int]()
    capacities = list(range(500, 20_000, 173))  # bytes

    def sync(file):
        if sum(each.stat().st_size for each in tmp_path.rglob("*") if each.is_file()) > capacities[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(file)

    fake()
    whole = encode(path)
    while capacities:
        path.write_bytes(b"old")
        with monkeypatch.context() as full:
            full.setattr(module, "sync", sync)
            full.setattr(write, "sync", sync)
            try:
                encode(path)
                break
            except InputError as error:
                assert "a.reel: cannot be written (No space left" in str(error) and "free space" in str(error)
        del capacities[0]
        assert path.read_bytes() == b"old" and {file.name for file in tmp_path.iterdir()} <= {"a.reel", "a.reel.part"}
        if kept(path):
            left.add(len(kept(path)) - 1)
            assert encode(path, resume=True) == whole
    assert path.read_bytes() == whole and left == set(range(1, 8))


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "best"])
def test_a_stopped_scene_continues_to_the_same_bytes(tmp_path, preset, monkeypatch):
    encoder, options = Encoder(scene(4)), replace(quick(preset, group_size=1), key_interval=0.1)
    encoder.encode(tmp_path / "whole.reel", options)
    real, calls = recipe.encode_interval, []

    def stops(*arguments):
        calls.append(1)
        if len(calls) >= 4:  # in whatever thread
            raise Stopped
        return real(*arguments)

    monkeypatch.setattr(recipe, "encode_interval", stops)
    with pytest.raises(Stopped):
        encoder.encode(tmp_path / "a.reel", options)
    monkeypatch.undo()
    summary = encoder.encode(tmp_path / "a.reel", options, resume=True)
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()
    assert summary.continued == 3 and summary.size == (tmp_path / "a.reel").stat().st_size


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The folder of a rig before which a ball moves through a room."""
    folder = tmp_path_factory.mktemp("take")
    cameras = [camera("front"), camera("left", 20)]
    return record(folder / "rig", cameras, [(0.1 * k, 0, 0) for k in range(4)])


def test_a_scene_that_was_taken_apart_is_not_taken_apart_again_nor_are_its_frames_read_before_they_are_coded(
    recorded, tmp_path, monkeypatch
):
    options = replace(quick("paper", group_size=1), key_interval=0.04)
    Encoder(open_recording(recorded)[0]).encode(tmp_path / "whole.reel", options)
    real, calls = recipe.encode_interval, list[int]()

    def stops(interval, *rest):
        calls.append(interval.first_frame)
        if len(calls) == stop:
            raise Stopped
        return real(interval, *rest)

    monkeypatch.setattr(recipe, "encode_interval", stops)
    taken = list[int]()
    for stop in (1, 3, 0):
        taken.clear()
        monkeypatch.setattr(sequence_module, "take_apart", lambda *given: taken.append(1) or take_apart(*given))
        monkeypatch.setattr(surveying, "survey_sequence", lambda *given: taken.append(2) or survey_sequence(*given))
        calls.clear()
        encoder = Encoder(open_recording(recorded)[0])
        if stop:
            with pytest.raises(Stopped):
                encoder.encode(tmp_path / "a.reel", options, resume=stop > 1 or None)
        else:
            assert encoder.encode(tmp_path / "a.reel", options, resume=True).continued == 2
        assert taken == ([2, 1] if stop == 1 else [])
        if stop == 1:
            assert {"scene.npz", "whole.json"} <= set(names_in(tmp_path / "a.reel"))
            with pytest.raises(InputError, match=r"has the parts of the scene, of an encode that was stopped"):
                Encoder(open_recording(recorded)[0]).encode(tmp_path / "a.reel", options)
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()


def test_a_picture_that_has_changed_is_noticed_though_its_interval_is_done(recorded, tmp_path, fake):
    shutil.copytree(recorded, rig := tmp_path / "rig")
    options = replace(quick("paper", group_size=1), key_interval=0.04)
    fake(stop=3)
    with pytest.raises(Stopped):
        Encoder(open_recording(rig)[0]).encode(tmp_path / "a.reel", options)
    first, *_, last = sorted((rig / "front" / "depth").glob("*.png"))
    shutil.copy(last, first)
    fake()
    with pytest.raises(InputError, match=r"a.reel.part: is of another encode: surfaces\[0\]"):
        Encoder(open_recording(rig)[0]).encode(tmp_path / "a.reel", options, resume=True)


@pytest.mark.parametrize("damage", [lambda data: data[:-9], lambda data: data[:99] + b"??" + data[101:], None])
def test_damaged_parts_of_a_scene_are_found_again(tmp_path, monkeypatch, damage):
    frames, options = scene(4), replace(quick("paper", group_size=1), key_interval=0.1)
    Encoder(frames).encode(tmp_path / "whole.reel", options)
    real, calls, path = recipe.encode_interval, [], tmp_path / "a.reel.part" / "scene.npz"
    monkeypatch.setattr(
        recipe, "encode_interval", lambda *given: calls.append(1) or stop_at(len(calls), 3) or real(*given)
    )
    with pytest.raises(Stopped):
        Encoder(frames).encode(tmp_path / "a.reel", options)
    monkeypatch.setattr(recipe, "encode_interval", real)
    path.unlink() if damage is None else path.write_bytes(damage(path.read_bytes()))
    assert Encoder(frames).encode(tmp_path / "a.reel", options, resume=True).continued == 2
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()


def stop_at(number, last):
    if number == last:
        raise Stopped
