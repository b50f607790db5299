"""Work in processes of this computer and on a real Dask scheduler: each piece once, also where a process is killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from dbbstation.tasks import executors
from dbbstation.tasks.executors import Ended, SchedulerError, WorkPool
from tests.cli.conftest import call
from tests.tasks.fleet_sessions import machines
from tests.tasks.pieces import ends_always, ends_once, squared, told_and_slow

ROOT = Path(__file__).parents[2]
PATIENCE_S = 120.0


class Cluster:
    """A scheduler and its workers, each a process of its own on loopback."""

    def __init__(self, folder):
        self.folder = folder
        self.address = ""
        self.workers = []
        self._every = []

    def __enter__(self):
        where = self.folder / "scheduler.json"
        words = ["scheduler", "--host", "tcp://127.0.0.1", "--port", "0", "--no-dashboard", "--no-show"]
        self._start([*words, "--scheduler-file", str(where)])
        self.address = _waited_for(lambda: _address(where))
        return self

    def __exit__(self, *_):
        for one in reversed(self._every):
            if one.poll() is None:
                one.kill()
            one.wait(PATIENCE_S)

    def add_worker(self, threads=1):
        place = self.folder / f"worker-{len(self.workers)}"
        words = [
            "worker",
            self.address,
            "--host",
            "tcp://127.0.0.1",
            "--nthreads",
            str(threads),
            "--no-nanny",
            "--no-dashboard",
        ]
        self.workers.append(self._start([*words, "--local-directory", str(place)]))

    def _start(self, words):
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        environment = {**os.environ, "PYTHONPATH": path.rstrip(os.pathsep)}
        with (self.folder / f"log-{len(self._every)}.txt").open("wb") as log:
            one = subprocess.Popen(
                [sys.executable, "-m", "dask", *words], cwd=self.folder, env=environment, stdout=log, stderr=log
            )
        self._every.append(one)
        return one


def _address(file):
    import json  # noqa: PLC0415 - beside its one use

    try:
        return json.loads(file.read_text("utf-8"))["address"]
    except (OSError, ValueError, KeyError):
        return ""


def _waited_for(what):
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        if found := what():
            return found
        time.sleep(0.1)
    return pytest.fail("it did not happen in time")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    pytest.importorskip("distributed")
    with Cluster(tmp_path_factory.mktemp("cluster")) as one:
        one.add_worker()
        one.add_worker()
        yield one


def test_processes_do_each_piece_once(tmp_path):
    found = dict(WorkPool(2).each(squared, [(k, str(tmp_path)) for k in range(6)]))
    assert {place: number for place, (number, _) in found.items()} == {k: k**2 for k in range(6)}
    assert os.getpid() not in {pid for _, pid in found.values()}


def test_a_process_that_is_killed_loses_nothing(tmp_path):
    items = [(k if k != 2 else -2, str(tmp_path)) for k in range(5)]
    found = list(WorkPool(2).each(ends_once, items))
    assert sorted(place for place, _ in found) == list(range(5))
    assert {place: number for place, (number, _) in found} == {k: k**2 for k in range(5)}


def test_what_kills_every_process_is_named_and_the_rest_is_done(tmp_path):
    items = [(k if k != 1 else -1, str(tmp_path)) for k in range(4)]
    found = dict(WorkPool(2).each(ends_always, items))
    assert isinstance(found[1], Ended)
    assert {place: found[place][0] for place in (0, 2, 3)} == {0: 0, 2: 4, 3: 9}


def test_workers_of_a_scheduler_do_the_same(cluster, tmp_path):
    found = dict(WorkPool(1, cluster.address).each(squared, [(k, str(tmp_path)) for k in range(6)]))
    assert {place: number for place, (number, _) in found.items()} == {k: k**2 for k in range(6)}
    assert {pid for _, pid in found.values()} <= {one.pid for one in cluster.workers}


def test_a_worker_with_another_program_is_refused(cluster, monkeypatch):
    own, here = executors.program_identity(), os.getpid()
    monkeypatch.setattr(
        executors, "program_identity", lambda: {**own, "code": "0" * 64} if os.getpid() == here else own
    )
    with pytest.raises(SchedulerError, match="has another program: code"):
        list(WorkPool(1, cluster.address).each(squared, [(1, "")]))


def test_a_scheduler_that_is_not_there_is_said(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "REACHED_S", 1.0)
    with pytest.raises(SchedulerError, match="no scheduler answers"):
        list(WorkPool(1, "tcp://127.0.0.1:9").each(squared, [(1, "")]))


def test_a_server_that_takes_a_connection_and_is_mute_is_given_up(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "REACHED_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        begun_s = time.monotonic()
        with pytest.raises(SchedulerError, match="no scheduler answers"):
            list(WorkPool(1, f"tcp://127.0.0.1:{mute.getsockname()[1]}").each(squared, [(1, "")]))
        assert time.monotonic() - begun_s < 10.0


def test_workers_are_looked_at_before_they_work(tmp_path, monkeypatch):
    """None is there; then one with two threads, which would share a lock and change what the other prints."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(executors, "REACHED_S", 2.0)
    with Cluster(tmp_path) as one:
        with pytest.raises(SchedulerError, match="no workers"):
            list(WorkPool(1, one.address).each(squared, [(1, "")]))
        one.add_worker(threads=2)
        monkeypatch.setattr(executors, "REACHED_S", PATIENCE_S)
        with pytest.raises(SchedulerError, match="has 2 threads"):
            list(WorkPool(1, one.address).each(squared, [(1, "")]))


def test_a_worker_that_is_killed_in_mid_run_loses_nothing_and_counts_nothing_twice(tmp_path):
    pytest.importorskip("distributed")
    with Cluster(tmp_path) as one:
        one.add_worker()
        one.add_worker()
        victim = one.workers[0]
        work = tmp_path / "work"
        work.mkdir()

        def kill():
            _waited_for(lambda: list(work.glob(f"*-{victim.pid}")))
            victim.send_signal(signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        found = list(WorkPool(1, one.address).each(told_and_slow, [(k, str(work)) for k in range(8)]))
        killer.join()
        assert victim.wait(PATIENCE_S) == -signal.SIGKILL
        assert sorted(place for place, _ in found) == list(range(8))
        assert {place: number for place, (number, _) in found} == {k: k**2 for k in range(8)}
        assert {pid for _, (_, pid) in found if pid != victim.pid} == {one.workers[1].pid}


def test_a_fleet_on_a_scheduler_has_the_numbers_of_one_process_bit_by_bit(cluster, tmp_path):
    sessions = machines(tmp_path / "sessions", 2)
    for name, words in (("one", ["--jobs", "1"]), ("two", ["--jobs", "2"]), ("dask", ["--scheduler", cluster.address])):
        done = call("fleet", sessions, "--task", "calibrate", "--out", tmp_path / name, *words)
        assert done.code == 0, done.err
    for name in ("two", "dask"):
        assert (tmp_path / name / "calibrate.csv").read_bytes() == (tmp_path / "one" / "calibrate.csv").read_bytes()
        for file in sorted((tmp_path / "one" / "calibrate").iterdir()):
            assert (tmp_path / name / "calibrate" / file.name).read_bytes() == file.read_bytes()
