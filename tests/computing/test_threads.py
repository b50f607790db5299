"""Fits run with one thread of linear algebra, whoever calls them, and give the threads back."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from dbbstation.calibration.fit import calibrate as fit
from dbbstation.calibration.reporting.prediction import predicted_circles
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.compare.comparison import compare
from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.files.places import shipped_folder
from dbbstation.inference.channel import Kind, Variable
from dbbstation.model.machine_model import MachineModel
from dbbstation.tasks.load import load_sessions

THREADS = 2


class Seen(Exception):  # noqa: N818 - no error: it ends work that has shown enough
    """How many threads there were."""


@pytest.fixture(autouse=True)
def several_threads():
    with ThreadpoolController().limit(limits=THREADS, user_api="blas"):
        assert counts() == {THREADS}
        yield
        assert counts() == {THREADS}


def counts():
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


def told(*_stage):
    raise Seen(counts())


@with_one_thread
def nested():
    return counts(), with_one_thread(counts)(), counts()


def test_the_limit_holds_inside_whatever_is_nested_and_not_behind():
    assert nested() == ({1}, {1}, {1})
    assert counts() == {THREADS}


def test_an_error_gives_the_threads_back():
    with pytest.raises(Seen):
        with_one_thread(told)("")
    assert counts() == {THREADS}


def test_of_two_that_work_at_once_the_last_gives_them_back():
    begun, end = threading.Event(), threading.Event()

    @with_one_thread
    def long():
        begun.set()
        assert end.wait(60.0)

    other = threading.Thread(target=long)
    other.start()
    try:
        assert begun.wait(60.0)
        assert with_one_thread(counts)() == {1}
        assert counts() == {1}
    finally:
        end.set()
        other.join()
    assert counts() == {THREADS}


def test_the_one_that_ends_last_need_not_have_begun_first():
    begun, end = threading.Event(), threading.Event()

    @with_one_thread
    def first():
        begun.set()
        assert end.wait(60.0)

    @with_one_thread
    def last():
        end.set()
        other.join()
        return counts()

    other = threading.Thread(target=first)
    other.start()
    assert begun.wait(60.0)
    assert last() == {1}
    assert counts() == {THREADS}


def test_a_function_stays_what_it_was():
    assert fit.calibrate.__name__ == "calibrate"
    assert (fit.calibrate.__doc__ or "").startswith("Fit error sources to raw circles.")


@pytest.fixture(scope="module")
def small():
    return load_sessions([shipped_folder("fixtures") / "sessions" / "small"])


def test_a_fit_has_one_thread_wherever_it_solves(small, monkeypatch):
    seen = []
    solve = fit.solve

    def spied(*arguments):
        seen.append(counts())
        return solve(*arguments)

    monkeypatch.setattr(fit, "solve", spied)
    fit.calibrate(small.machine, small.observations)
    assert seen
    assert all(count == {1} for count in seen)


def of_the_diagnosis(small):
    diagnose(small.machine, small.observations, (), told)


def of_the_comparison(small):
    compare(small.machine, small.observations, small.observations, progress=told)


def of_predicted_circles(small):
    predicted_circles(MachineModel(small.machine), small.observations, told)


def of_a_drive(_small):
    identify([], (), progress=told)


def of_a_table(_small):
    time_s = np.linspace(0.0, 10.0, 400)
    table = Table(
        measured=np.sin(time_s),
        simulated=np.cos(time_s),
        unit="mm",
        simulated_name="simulated",
        variables=(Variable("time", "s", Kind.TIME, time_s),),
        derivatives={},
        columns={},
        blocks=(slice(0, 400),),
        names=("run",),
        clock=None,
    )
    find_mismatch(table, progress=told)


@pytest.mark.parametrize(
    "work",
    [of_the_diagnosis, of_the_comparison, of_predicted_circles, of_a_drive, of_a_table],
    ids=lambda one: one.__name__,
)
def test_long_work_has_one_thread_when_it_says_how_far_it_is(small, work):
    with pytest.raises(Seen) as seen:
        work(small)
    assert seen.value.args == ({1},)
