"""Calls in workers: few at a time, done in any order; a task of an encode is small, and only workers read the files."""

import pickle
import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace

import fsspec
import numpy as np
import pytest

from meshreel.analysis.front import frames_looked_at
from meshreel.encoder.group.forms import EncodedGroup, Fidelity
from meshreel.encoder.run import schedule as recipe
from meshreel.encoder.run.schedule import AHEAD, as_done, workers_of
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.io import sequence as io
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.io.write import write_mesh
from tests.small_options import quick
from tests.spheres import sliding_sphere

FRAMES = 70
EACH_ALONE = replace(quick(key_interval=0.1), scene=None)


class Scrambled(Executor):
    """Three workers that have but what was pickled for them; of the calls that are out, the newest is done first."""

    _max_workers = 3

    def __init__(self) -> None:
        self.sizes, self.out, self.most, self.lock = list[int](), list[tuple[Future, bytes]](), 0, threading.Lock()
        self.timers = list[threading.Timer]()

    def submit(self, function, /, *arguments):
        self.sizes.append(len(call := pickle.dumps((function, arguments))))
        with self.lock:
            self.out.append((future := Future(), call))
            self.most, full = max(self.most, len(self.out)), len(self.out) == AHEAD * self._max_workers
        timer = threading.Timer(0.0 if full else 0.2, self.do_all)  # later, where nothing more comes
        self.timers.append(timer)
        timer.start()
        return future

    def shutdown(self, **_):
        for timer in self.timers:
            timer.join()

    def do_all(self):
        with self.lock:
            calls, self.out = self.out[::-1], []
        self.work(calls)

    @staticmethod
    def work(calls):
        for future, call in calls:
            if future.set_running_or_notify_cancel():
                function, arguments = pickle.loads(call)
                try:
                    future.set_result(pickle.loads(pickle.dumps(function(*arguments))))
                except Exception as error:
                    future.set_exception(error)


def squared(number):
    if number in (7, 5):
        raise ValueError(number)
    return number * number


def test_results_come_in_any_order_and_few_calls_are_out():
    executor = Scrambled()
    found = list(as_done(executor, ((n, squared, (n,)) for n in range(20, 60))))
    assert sorted(found) == [(n, n * n) for n in range(20, 60)] != found
    assert executor.most <= AHEAD * workers_of(executor)


def test_of_calls_that_fail_the_first_is_told():
    with pytest.raises(ValueError, match="5"):
        list(as_done(Scrambled(), ((n, squared, (n,)) for n in range(20))))


def test_the_number_of_workers_is_the_executors_own():
    with ThreadPoolExecutor(5) as executor:
        assert workers_of(executor) == 5

    class Cluster(Executor):
        class _client:
            @staticmethod
            def nthreads():
                return {"a": 2, "b": 1}

    assert workers_of(Cluster()) == 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Mesh files of a ball that slides."""
    folder = tmp_path_factory.mktemp("balls")
    for number, mesh in enumerate(sliding_sphere(FRAMES, levels=1)):
        write_mesh(mesh, folder / f"frame_{number:05}.ply")
    return folder


@pytest.fixture
def plainly(monkeypatch):
    """Intervals whose payloads depend on the frames alone."""

    def encode_interval(interval, *_):
        for frame in interval.frames:
            payload = bytes([Form.DRACO]) + np.round(frame.vertices, 3).tobytes()
            yield EncodedGroup(Form.DRACO, 1, payload, (5, len(payload)), Fidelity(0.1, 2.0, 0.3, 60.1))

    monkeypatch.setattr(recipe, "encode_interval", encode_interval)


def opened(folder):
    return open_sequence(folder, SequenceOptions(10.0))


@pytest.mark.usefixtures("plainly")
@pytest.mark.parametrize("by_url", [False, True])
def test_workers_read_the_files_and_the_bytes_are_those_of_one_process(folder, tmp_path, monkeypatch, by_url):
    if by_url:
        fsspec.filesystem("memory").put(f"{folder}/", "/balls", recursive=True)
    readers, read = set(), io.read_mesh
    monkeypatch.setattr(io, "read_mesh", lambda *where: readers.add(threading.get_ident()) or read(*where))
    one, many, executor = opened(folder), opened("memory://balls" if by_url else folder), Scrambled()
    Encoder(one, jobs=1).encode(tmp_path / "one.reel", EACH_ALONE)
    assert readers == {threading.get_ident()}
    readers.clear()
    summary = Encoder(many, executor).encode(tmp_path / "many.reel", EACH_ALONE)
    assert readers - {threading.get_ident()} and max(executor.sizes) < 5000
    assert (tmp_path / "one.reel").read_bytes() == (tmp_path / "many.reel").read_bytes()
    looked_at = len(frames_looked_at(FRAMES, 10.0))  # here, for the first view
    assert summary.work["frames read"] == 2 * FRAMES + looked_at and many.warnings == one.warnings


@pytest.mark.usefixtures("plainly")
def test_a_task_does_not_grow_with_the_sequence(folder, tmp_path):
    executor, options = Scrambled(), replace(EACH_ALONE, key_interval=3.0)
    Encoder(opened(folder), executor).encode(tmp_path / "a.reel", options)
    tasks = executor.sizes[-3:]  # of 24 frames each
    Encoder(open_sequence(sorted(folder.iterdir()) * 5, SequenceOptions(10.0)), executor).encode(
        tmp_path / "a.reel", options
    )
    assert max(executor.sizes[-12:]) < 1.2 * max(tasks) < 6000


def test_a_file_that_changes_between_two_readings_is_refused(folder, tmp_path, monkeypatch):
    def encode_interval(interval, *_):
        where = tmp_path / "some" / "frame_00004.ply"
        write_mesh(sliding_sphere(9, levels=1)[8], where)
        list(interval.frames)
        yield EncodedGroup(Form.EMPTY, len(interval.frames), bytes([Form.EMPTY]), (), Fidelity(0.0, 0.0, 0.0, 60.0))

    (tmp_path / "some").mkdir()
    for path in sorted(folder.iterdir())[:6]:
        (tmp_path / "some" / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(recipe, "encode_interval", encode_interval)
    with pytest.raises(InputError, match=r"frame 4 \(.*frame_00004.ply\): has changed while it was encoded"):
        Encoder(opened(tmp_path / "some"), Scrambled()).encode(tmp_path / "a.reel", EACH_ALONE)


@pytest.mark.usefixtures("plainly")
def test_intervals_that_were_done_out_of_order_are_not_done_again(folder, tmp_path, monkeypatch):
    """The first interval fails when later ones are done."""
    Encoder(opened(folder)).encode(tmp_path / "whole.reel", EACH_ALONE)
    plain, calls = recipe.encode_interval, list[int]()

    def fails(interval, *rest):
        calls.append(interval.first_frame)
        if interval.first_frame == 1:
            raise InputError("no")
        return plain(interval, *rest)

    monkeypatch.setattr(recipe, "encode_interval", fails)
    with Scrambled() as executor, pytest.raises(InputError, match="no"):
        Encoder(opened(folder), executor).encode(tmp_path / "a.reel", EACH_ALONE)
    assert set(calls) > {0, 1}
    calls.clear()
    monkeypatch.setattr(
        recipe, "encode_interval", lambda interval, *_: calls.append(interval.first_frame) or plain(interval)
    )
    summary = Encoder(opened(folder)).encode(tmp_path / "a.reel", EACH_ALONE, resume=True)
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()
    assert summary.continued and len(calls) == FRAMES - summary.continued
