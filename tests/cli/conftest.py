"""The command line in this process, and sessions of an independent virtual machine to run it on."""

from __future__ import annotations

import hashlib
import io
import json
import re
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dbbstation.cli import cli, main
from studies.__main__ import study
from tests.once import OF_SESSIONS, OF_TABLES, computed_once, made_once
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import elevated, subset, table_ii_plan
from tests.plant.session import record


@dataclass(frozen=True)
class Outcome:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def data(self):
        return json.loads(self.out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


def call(*arguments, err=None) -> Outcome:
    """Run the command line as `dbbstation ARGUMENTS` would, or a study; standard error may be a stream that is there already."""
    group, arguments = (study, arguments[1:]) if arguments[:1] == ("study",) else (cli, arguments)
    out, err = io.StringIO(), err or io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments], group)
    return Outcome(left.value.code, out.getvalue(), err.getvalue() if isinstance(err, io.StringIO) else "")


@pytest.fixture(scope="session")
def run() -> Callable[..., Outcome]:
    return call


@pytest.fixture(scope="module")
def answers_kept(tmp_path_factory):
    """Commands that print, write and draw one answer compute it once; for modules that ask for it."""
    with pytest.MonkeyPatch.context() as patch:
        computed_once(tmp_path_factory, patch, *OF_SESSIONS, *OF_TABLES)
        yield


@pytest.fixture(scope="session")
def errors() -> Kinematics:
    rng = np.random.default_rng(3)
    return Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=rng.normal(0, 0.1, (6, 3)))


@pytest.fixture(scope="session")
def fifteen(tmp_path_factory, errors) -> Path:
    """Fifteen circles, five of them raised: all 24 parameters show."""

    def make(folder: Path) -> None:
        plan = elevated(table_ii_plan(1), 5.0, "abcde")
        record(folder / "fifteen", seed=1, plan=plan, mechanisms=[errors], rate_hz=10.0)

    return made_once(tmp_path_factory, "recorded", make) / "fifteen"


@pytest.fixture(scope="session")
def elsewhere(tmp_path_factory, errors) -> Path:
    def make(folder: Path) -> None:
        plan = subset(table_ii_plan(2, scatter_mm=3.0), "dhk")
        record(folder / "elsewhere", seed=2, plan=plan, mechanisms=[errors], rate_hz=10.0)

    return made_once(tmp_path_factory, "elsewhere", make) / "elsewhere"


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory, fifteen) -> tuple[Path, Outcome]:
    def make(folder: Path) -> None:
        outcome = call("calibrate", fifteen, "--out", folder / "model.yaml", "--json")
        assert outcome.code == 0, outcome.err
        (folder / "printed.json").write_text(outcome.out, encoding="utf-8")
        (folder / "said.txt").write_text(outcome.err, encoding="utf-8")

    folder = made_once(tmp_path_factory, "calibrated", make)
    printed, said = ((folder / name).read_text(encoding="utf-8") for name in ("printed.json", "said.txt"))
    return folder / "model.yaml", Outcome(0, printed, said)


@pytest.fixture(scope="session")
def model(calibrated) -> Path:
    return calibrated[0]


@pytest.fixture(scope="session")
def _three(tmp_path_factory, errors) -> Path:

    def make(folder: Path) -> None:
        record(folder / "three", seed=5, plan=subset(table_ii_plan(5), "agl"), mechanisms=[errors], rate_hz=5.0)

    return made_once(tmp_path_factory, "three", make) / "three"


class Spoilt:
    """A copy of a small session, to be spoilt; a run that is changed gets its new hash noted, unless told otherwise."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        return self.folder / name

    def lines(self, name: str, change: Callable[[list[str]], list[str]], *, reseal: bool = True) -> Path:
        """Change a file by its lines, line ends included; index 0 is line 1."""
        path = self.folder / name
        before = hashlib.sha256(path.read_bytes()).hexdigest()
        path.write_text("".join(change(path.read_text(encoding="utf-8").splitlines(keepends=True))), encoding="utf-8")
        if reseal:
            self.replace("session.yaml", before, hashlib.sha256(path.read_bytes()).hexdigest())
        return path

    def replace(self, name: str, old: str, new: str) -> Path:
        path = self.folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text or name == "session.yaml"
        path.write_text(text.replace(old, new), encoding="utf-8")
        return path

    def line_of(self, name: str, what: str) -> int:
        for number, line in enumerate((self.folder / name).read_text(encoding="utf-8").splitlines(), start=1):
            if what in line:
                return number
        raise AssertionError(what)

    def column(self, name: str, column: int, change: Callable[[float], float]) -> Path:
        def each(line: str) -> str:
            if not re.match(r"[-\d]", line):
                return line
            cells = line.rstrip("\n").split(",")
            cells[column] = f"{change(float(cells[column])):.9g}"
            return ",".join(cells) + "\n"

        return self.lines(name, lambda lines: [each(line) for line in lines])


@pytest.fixture
def spoilt(tmp_path, _three) -> Spoilt:
    shutil.copytree(_three, tmp_path / "spoilt")
    return Spoilt(tmp_path / "spoilt")
