"""What several tests look at is made once a run, and kept in a folder that all workers share."""

from __future__ import annotations

import copyreg
import fcntl
import functools
import hashlib
import inspect
import os
import pickle
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import dbbstation
from dbbstation.files.inputs import input_book, note_input, open_book
from dbbstation.simulators.running import Runs

try:
    from cloudpickle import dumps  # comes with `distributed`; writes functions down, too
except ImportError:
    from pickle import dumps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pytest

OF_TABLES = ("dbbstation.tasks.mismatch.mismatch", "dbbstation.tasks.drive.identify")
"""Tasks on tables of the package, which documents show and tests look at."""

OF_SESSIONS = (
    *(f"dbbstation.tasks.{name}.{name}" for name in ("calibrate", "diagnose", "compare", "evaluate")),
    "dbbstation.tasks.drive.identify",
)
"""Tasks that a command carries out for each way of printing what it found."""

STUDIES = ("studies.concealed_gravity.concealed_gravity",)
"""Studies that a document shows and tests look at."""


class _Ran:
    """Simulations that were run, which a figure asks for again."""

    def __init__(self, known: dict[Any, Any]) -> None:
        self._known = known

    def __call__(self, asks: list[Any]) -> list[Any]:
        return [self._known[ask] for ask in asks]


# What runs simulations holds a lock and processes, which cannot be written down.
copyreg.pickle(Runs, lambda runs: (_Ran, (runs._known,)))

_Read: TypeAlias = tuple[dict[Path, str], set[Path]]
"""Files that were read while an answer was computed: hashes of those that outputs name, and all."""

TELLING = {"progress", "stop", "say"}
"""Arguments of a task by which it tells, and that are no part of what it is asked."""


def of_the_run(factory: pytest.TempPathFactory) -> Path:
    base = factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "once"
    folder.mkdir(exist_ok=True)
    return folder


@contextmanager
def alone(place: Path) -> Iterator[None]:
    with place.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    folder = of_the_run(factory) / name
    with alone(folder):
        if not folder.exists():
            new = folder.with_suffix(".new")
            new.mkdir()
            make(new)
            new.rename(folder)
    return folder


def computed_once(factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch, *tasks: str) -> None:
    """Compute the answer of a task once for the same request and the same files; what a command prints and draws of it is not kept."""
    for task in tasks:
        module, _, name = task.rpartition(".")
        kept = _kept(getattr(import_module(module), name), of_the_run(factory))
        if name in dbbstation.__all__:  # the same under its public name, which is kept once it is loaded
            patch.setattr(dbbstation, name, kept)
        patch.setattr(task, kept)


_HERE: dict[Path, tuple[list[str], object, _Read]] = {}
"""Answers that cannot be written down, or cannot be read here: each worker computes them."""


def _kept(task: Callable[..., Any], folder: Path) -> Callable[..., Any]:
    if hasattr(task, "kept_in"):  # by another fixture: a lock in a lock of the same name would wait for ever
        return task
    tells = "say" in inspect.signature(task).parameters

    @functools.wraps(task)
    def ask(*words: object, **more: Any) -> Any:
        wanted = {name: value for name, value in more.items() if name not in TELLING}
        asked = repr((task.__module__, task.__name__, _request(words), _request(wanted)))
        place = folder / f"{hashlib.sha256(asked.encode()).hexdigest()}.pickle"
        if place in _HERE:
            _note_read(_HERE[place][2])
            return _told(*_HERE[place][:2], more)
        with alone(place):
            kept = _kept_at(place)
            if kept is None:
                told: list[str] = []

                def say(text: str) -> None:
                    told.append(text)
                    _told([text], None, more)

                with input_book() as book:
                    answer = task(*words, **{**more, **({"say": say} if tells else {})})
                kept = told, answer, (dict(book._digests), book._read)
                more = {name: one for name, one in more.items() if name != "say"}  # it has been told
                try:
                    written = b"" if place.exists() else dumps(kept)  # what is there, this worker cannot read
                except (AttributeError, TypeError, pickle.PicklingError):
                    written = b""
                if written:
                    place.write_bytes(written)
                else:
                    _HERE[place] = kept
        _note_read(kept[2])
        _note_files((*words, *wanted.values()))
        return _told(*kept[:2], more)

    ask.kept_in = folder
    return ask


def _kept_at(place: Path) -> tuple[list[str], object, _Read] | None:
    """Answer that a worker wrote down; None without one, or if it names a file of sources that only that worker has loaded."""
    try:
        return pickle.loads(place.read_bytes())  # type: ignore[no-any-return]  # noqa: S301 - written above
    except (FileNotFoundError, ImportError, AttributeError):
        return None


def _told(told: list[str], answer: object, more: dict[str, Any]) -> object:
    """A module that was imported meanwhile keeps the cached task, and may call it without `say`."""
    for text in told if "say" in more else ():
        more["say"](text)
    return answer


def _note_read(read: _Read) -> None:
    for path, digest in read[0].items():
        note_input(path, digest)
    for path in read[1]:
        open_book().note_read(path)


def _note_files(values: tuple[object, ...]) -> None:
    """Files count as read, as they do where the task reads them itself: outputs name them."""
    for value in values:
        for one in value if isinstance(value, tuple | list) else [value]:
            if isinstance(one, str | Path) and one and Path(one).is_file():
                note_input(Path(one), hashlib.sha256(Path(one).read_bytes()).hexdigest())


def _request(value: object) -> object:
    """What is asked, a file or a folder by its name and content wherever it lies."""
    if isinstance(value, str | Path) and value and Path(value).exists():
        path = Path(value)
        files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
        return path.name, [(str(one.relative_to(path)), hashlib.sha256(one.read_bytes()).hexdigest()) for one in files]
    if isinstance(value, dict):
        return sorted((name, _request(one), _request(_named_by(name, one))) for name, one in value.items())
    if isinstance(value, tuple | list):
        return [_request(one) for one in value]
    return value if isinstance(value, bool | int | float | str | Path | None) else _content(value)


def _content(value: object) -> object:
    """Hash of arrays, and of objects that hold any: their text leaves out all but the ends."""
    try:
        return hashlib.sha256(dumps(value)).hexdigest()
    except (AttributeError, TypeError, pickle.PicklingError):
        return value


def _named_by(name: str, value: object) -> object:
    """Folder of a simulator's file: the file names others that lie beside it."""
    return Path(value).parent if name == "simulator" and isinstance(value, str | Path) else None
