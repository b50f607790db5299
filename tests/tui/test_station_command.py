"""`dbbstation station` on the command line, and who loads Textual."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from dbbstation.cli import COMMANDS
from dbbstation.cli.station import station
from dbbstation.files.formats.plan import plan_data, read_inline_plan
from dbbstation.files.shipped import shipped_folder
from dbbstation.service.order import Gate, Order, ordered
from tests.cli.conftest import call

REAL = ["--plan", "p.yaml", "--machine", "m.yaml", "--instrument", "heidenhain-nd281b", "--port", "COM3", "--out", "s"]


def run(*arguments: str) -> None:
    CliRunner().invoke(station, arguments, catch_exceptions=False, standalone_mode=False)


def refusal(*arguments: str) -> str:
    result = CliRunner().invoke(station, arguments, standalone_mode=False)
    assert isinstance(result.exception, click.UsageError)
    return result.exception.format_message()


def test_help_has_examples() -> None:
    text = CliRunner().invoke(station, ["--help"]).stdout
    assert "dbbstation station --virtual" in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "the screen needs a terminal"),
        (["--plan", "p.yaml"], "missing --machine, --instrument, --port, --out; or --virtual"),
        (REAL[:-2], "missing --out"),
        (["--virtual", "--port", "COM3"], "leave out --port"),
        (["--virtual", "--baud", "9600"], "leave out --port and --baud"),
        ([*REAL, "--time-scale", "5"], "--time-scale goes with --virtual"),
        (["--virtual"], "the screen needs a terminal; `dbbstation measure` does the same without one"),
        (REAL, "the screen needs a terminal"),
    ],
)
def test_refusals(arguments: list[str], says: str) -> None:
    assert says in refusal(*arguments)


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"station"}))
def test_no_other_command_loads_the_screen(name: str) -> None:
    code = (
        "import importlib, pkgutil, sys\n"
        "from dbbstation.cli import cli\n"
        f"command = cli.get_command(None, {name!r})\n"
        "loaded = {'textual', 'rich', 'dbbstation.tui'} & set(sys.modules)\n"
        "sys.exit(', '.join(sorted(loaded)) or None)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if "No module named 'dbbstation.cli." in done.stderr:
        pytest.skip(f"`{name}` is announced in the table and not there yet")
    assert done.stderr == ""


def test_what_runs_without_a_screen_never_loads_it() -> None:
    # The whole engine of `measure`, not only its command line.
    code = (
        "import sys\n"
        "import dbbstation.station.assembly, dbbstation.station.autopilot, dbbstation.virtual.control\n"
        "sys.exit(', '.join(sorted({'textual', 'dbbstation.tui'} & set(sys.modules))) or None)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_the_help_of_the_station_does_not_load_the_screen_either() -> None:
    code = "import sys; import dbbstation.cli.station; sys.exit('textual' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_order_job_and_programs_reach_the_session_and_the_start_screen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = importlib.import_module("dbbstation.cli.station")
    seen: list[Any] = []
    monkeypatch.setattr(module, "_check_terminal", lambda: None)
    monkeypatch.setattr(module, "_run", lambda job, _open, _line: seen.append(job) or 0)
    monkeypatch.setattr(module, "_begin", lambda given, _limits, _model: seen.append(given) or 0)
    shipped = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    folder = tmp_path / "programs"
    done = call("program", "--plan", shipped, "--machine", machine, "--out", folder)
    assert done.code == 0, done.err
    said = ["--order", "drift", "--gate", "first", "--job", "order 4711", "--programs", str(folder)]
    files = ["--plan", str(shipped), "--machine", str(machine), "--out", str(tmp_path / "s")]
    run(*REAL[4:-2], *files, "--bar-waiver", "a first look", *said)
    run(*said)
    job, given = seen
    planned = ordered(read_inline_plan(shipped), Order.DRIFT, Gate.FIRST)
    assert plan_data(job.plan) == plan_data(planned)
    assert set(job.programs) == {
        (name, way) for name, test in planned.to_domain().tests.items() for way in test.directions
    }
    assert job.details.job == given.job == "order 4711"
    assert (given.order, given.gate, given.programs) == (Order.DRIFT, Gate.FIRST, folder)
