"""`settings shipped`, and the examples of help texts from an empty folder with what it copies there."""

from __future__ import annotations

import contextlib
import shlex
import shutil
from pathlib import Path

import pytest

from dbbstation.cli.shipped import shipped_files
from tests.cli.conftest import call
from tests.cli.test_help import LINES, examples, found
from tests.once import made_once

QUICK = (
    "check",
    "circles",
    "control",
    "evaluate",
    "export",
    "instruments",
    "jig",
    "ports",
    "program",
    "session",
    "settings",
    "sources",
)

LONGER = (
    "calibrate",
    "compare",
    "compensate",
    "diagnose",
    "fleet",
    "history",
    "identify",
    "import",
    "mismatch",
    "predict",
    "report",
    "simulate",
)

OF_ONES_OWN = {
    "--anchor": "an anchor that was noted of one's own session",
    "--leave-out": "a model with backlash",
    "session amend": "a sealed session in which something was changed since",
    "session rebuild": "a session whose file was lost",
    "evaluate predicted": "what the line above wrote",
    "compare predicted": "what `simulate` wrote",
    "--scheduler": "a scheduler with workers",
    "--pdf": "a browser",
    "--model joint.yaml": "what `diagnose` wrote",
    "monday tuesday": "two sessions of a machine",
    "compare 2025": "two sessions of a machine",
    "drive-friction": "a session with currents",
}
"""Parts of examples that need more than files, with what they need."""


def runnable(commands):
    lines = [line for name in LINES for line in examples(found(name.split())[0].help)]
    return [
        line
        for line in dict.fromkeys(lines)
        if line.split()[1] in commands and not any(one in line for one in OF_ONES_OWN)
    ]


def all_but_the_first_by_night(lines):
    """Return a command's first line for CI, the others for the night."""
    first = {line.split()[1]: line for line in reversed(lines)}
    return [line if first[line.split()[1]] == line else pytest.param(line, marks=pytest.mark.nightly) for line in lines]


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    def make(folder):
        done = call("settings", "shipped", "examples", "--out", folder / "try")
        assert done.code == 0

    return made_once(tmp_path_factory, "shipped-examples", make) / "try"


@pytest.fixture
def folder(tmp_path, written):
    return shutil.copytree(written, tmp_path / "try")


def said(folder, line):
    words = shlex.split(line.partition("   (")[0].partition(" > ")[0])[1:]
    with contextlib.chdir(folder):
        # A shell expands patterns.
        return call(
            *(name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word]))
        )


@pytest.mark.parametrize("line", runnable(QUICK))
def test_examples_of_quick_commands_run(folder, line):
    done = said(folder, line)
    assert done.code == 0, done.err


@pytest.mark.slow
@pytest.mark.usefixtures("answers_kept")
@pytest.mark.parametrize("line", all_but_the_first_by_night(runnable(LONGER)))
def test_examples_of_longer_commands_run(folder, line):
    done = said(folder, line)
    assert done.code == 0, done.err


def test_names_are_listed_and_each_is_copied(tmp_path):
    names = call("settings", "shipped", "--json").data["shipped"]
    assert {"plans/table2.yaml", "machines/reference.yaml", "sessions/small", "examples"} <= set(names)
    for name in ("plans", "plans/table2.yaml", "sessions/small", "simulators/"):
        out = tmp_path / name.replace("/", "-")
        assert call("settings", "shipped", name, "--out", out).code == 0
        inside = {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        assert inside
        for key, data in inside.items():
            source = next(path for one, path in shipped_files().items() if one in {f"{name.rstrip('/')}/{key}", name})
            assert source.read_bytes() == data


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["plons", "--out", "x"], "did you mean plans?"),
        (["plans"], "give NAME, which is copied"),
        (["--out", "x"], "give NAME, which is copied"),
    ],
)
def test_what_cannot_be_copied_is_said(tmp_path, words, what):
    with contextlib.chdir(tmp_path):
        done = call("settings", "shipped", *words)
        assert what in done.err
        assert done.code != 0
        assert list(tmp_path.iterdir()) == []
