"""A Dask cluster of worker processes: it writes the bytes of one process, also where a worker is killed on the way."""

import os
import signal
import sys
from dataclasses import replace

import distributed
import pytest
from distributed import LocalCluster

from meshreel.cli import workers as module
from meshreel.cli.workers import workers
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.io.write import write_mesh
from tests.small_options import quick
from tests.spheres import sliding_sphere

FRAMES = 12
EACH_ALONE = replace(quick(key_interval=0.1), scene=None)


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls")
    for number, mesh in enumerate(sliding_sphere(FRAMES, levels=2)):
        write_mesh(mesh, folder / f"frame_{number:05}.ply")
    return open_sequence(folder, SequenceOptions(10.0))


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_a_worker_that_is_killed_costs_no_byte(cluster, balls, tmp_path):
    killed = set[int]()

    def kill(now):
        if now.stage == "code" and now.done > 2 and not killed:
            killed.add(pids.pop())
            os.kill(*killed, signal.SIGKILL)

    with workers(1, cluster.scheduler_address) as executor:
        pids = list(executor._client.run(os.getpid).values())
        assert len(pids) == 2
        Encoder(balls, executor, kill).encode(tmp_path / "many.reel", EACH_ALONE)
    assert killed
    Encoder(balls).encode(tmp_path / "one.reel", EACH_ALONE)
    assert (tmp_path / "many.reel").read_bytes() == (tmp_path / "one.reel").read_bytes()


def test_a_result_of_a_worker_that_is_gone_is_a_result(cluster, monkeypatch):
    with workers(1, cluster.scheduler_address) as executor:
        monkeypatch.setattr(distributed.Future, "status", "lost")
        assert executor.submit(divmod, 7, 2).result(10.0) == (3, 1)


def test_what_a_call_raises_is_raised_here(cluster):
    with workers(1, cluster.scheduler_address) as executor, pytest.raises(ZeroDivisionError):
        executor.submit(divmod, 7, 0).result(10.0)


def test_workers_of_other_versions_are_refused(cluster, monkeypatch):
    monkeypatch.setattr(module, "__version__", "0.0.7")
    wrong = r"tcp://.*: is not installed as this machine is: meshreel \".*\", now \"0.0.7\" here"
    with pytest.raises(InputError, match=wrong), workers(1, cluster.scheduler_address):
        pass


def test_a_cluster_that_does_not_answer_is_an_error(monkeypatch):
    monkeypatch.setattr(module, "CONNECTS", 0.3)
    with (
        pytest.raises(InputError, match=r"--cluster tcp://127.0.0.1:9: no scheduler .*; start one"),
        workers(1, "tcp://127.0.0.1:9"),
    ):
        pass


def test_jobs_and_a_cluster_exclude_each_other():
    with pytest.raises(InputError, match="--jobs 2 and --cluster tcp://a:1"), workers(2, "tcp://a:1"):
        pass
