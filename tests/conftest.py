"""What every test may use: the reference machine, recordings made elsewhere."""

from __future__ import annotations

import functools
import gc
import os
import signal
import threading
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

# As the command line does, before NumPy looks: several workers with threads each wait for one another most of the time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Nobody's settings hold in tests, and sessions that are only read get no log beside them.
os.environ["XDG_CONFIG_HOME"] = str(Path(__file__).parent / "no-such-folder")
os.environ["XDG_DATA_HOME"] = os.devnull
os.environ["DBBSTATION_LOG"] = "off"

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml import text
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.geometry import Machine
from tests import copied

if TYPE_CHECKING:
    from collections.abc import Iterator

# A command reads one model, tests the same few again and again: as many are kept as 50 MB hold.
text._of_the_last = functools.lru_cache(maxsize=8)(text._parsed)


def pytest_sessionstart() -> None:
    """Let interrupts through: a shell starts programs in the background with them ignored, and programs under test inherit that."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # Without the garbage collector, collecting the tests takes two thirds of the time.
    gc.disable()


def pytest_collection_finish() -> None:
    """Spare the garbage collector the collected tests, each pass over which takes half a second, and let it pass more rarely: on screens
    it took an eighth of the time.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()


def pytest_xdist_auto_num_workers() -> int:
    """One worker more than cores: a third of a worker's time it waits, for lines, clocks and programs that it started."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(trylast=True)  # behind what leaves tests out
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files with slow tests first, whole and shared out: a slow test that begins last is waited for by all workers.

    Workers begin with equal parts of the list, one behind the other, and take from the ends of each other's parts. Files that lie
    highest test the most at once, and take longest. A file stays in one piece, so that what its tests share is made once.
    """
    of_slow = Counter(item.path for item in items if item.get_closest_marker("slow") is not None)
    whole, quick = defaultdict(list), []
    for item in items:
        (whole[item.path] if item.path in of_slow else quick).append(item)
    queues: list[list[pytest.Item]] = [[] for _ in range(getattr(config, "workerinput", {}).get("workercount", 1))]
    slow_in = [0] * len(queues)
    for path in sorted(of_slow, key=lambda path: len(path.parts)):
        least = slow_in.index(min(slow_in))
        queues[least] += whole[path]
        slow_in[least] += of_slow[path]
    left, begun = len(items), 0
    items.clear()
    for number, queue in enumerate(queues):
        size = left // (len(queues) - number)
        taken = max(size - len(queue), 0)
        items += queue + quick[begun : begun + taken]
        left, begun = left - size, begun + taken
    items += quick[begun:]


@pytest.fixture(scope="session")
def recordings() -> Path:
    folder = os.environ.get("DBBSTATION_RECORDINGS")
    if not folder:
        pytest.skip("DBBSTATION_RECORDINGS is not set: no recordings made elsewhere to test on")
    return Path(folder)


@pytest.fixture(scope="session")
def reference() -> Machine:
    return read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")


@pytest.fixture(scope="session")
def copies() -> Iterator[None]:
    """The process that `tests.copied` copies stands before a test begins, and is none of what the test leaves open."""
    with copied.kept_loaded():
        yield


@pytest.fixture
def copied_works(copies: None, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    copied.copied_works(monkeypatch)


@pytest.fixture(scope="module")
def few_parts(request: pytest.FixtureRequest) -> Iterator[None]:
    """Hold out four parts, the fewest that are judged, instead of ten, draw tests four times instead of twenty, refine two waves instead
    of six and propose no tests, which these tests do not look at; not in nightly tests.
    """
    with pytest.MonkeyPatch.context() as patch:
        if "not nightly" in request.config.option.markexpr:
            patch.setattr("dbbstation.inference.folds.BOUNDS", replace(BOUNDS, folds=4, selection_draws=4))
            patch.setattr("dbbstation.diagnosis.unmodelled.BOUNDS", replace(BOUNDS, made_finer=2))
            patch.setattr("dbbstation.diagnosis.diagnose.next_tests", lambda *_: ())
        yield


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20261121)
