"""Console blocks of README and documentation: their commands exist, and print what is shown."""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import dataclass, field
from pathlib import Path

import click
import numpy as np
import pytest

from dbbstation.cli import cli
from dbbstation.cli.diagnose import _print as print_diagnosis
from dbbstation.diagnosis.findings import Shift, SourceFinding, Unexplained
from dbbstation.facts import BeforeAfter
from dbbstation.files.places import shipped_folder
from dbbstation.inference.levels import DifferenceFound, Differs, Levels, Verdict
from dbbstation.results.diagnosis import DiagnosisFigures
from tests.cli.conftest import Outcome, call
from tests.once import OF_TABLES, STUDIES, computed_once
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record
from tests.sessions_over_time import sessions_over_time

HERE = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    "README.md",
    *sorted(
        path.relative_to(HERE).as_posix()
        for place in (".", "shop-floor")
        for path in (HERE / "docs" / place).glob("*.md")
    ),
]
MACHINE = HERE / "docs" / "shop-floor" / "1-prepare.md"
"""Page with the machine file of the examples."""

ANYTHING = "…"

EXEMPT = {
    ("README.md", "dbbstation demo"): "measures thirty circles twice, a minute or two; see tests/test_demo.py",
    ("README.md", "dbbstation diagnose measured"): "the session of the demonstration, which takes a minute to record",
    ("README.md", "dbbstation measure"): "a machine, thirty circles; see docs/getting-started.md",
    ("docs/calibration.md", "dbbstation calibrate standard-test"): "thirty circles that are in no repository",
    ("docs/currents.md", "dbbstation calibrate recorded"): "thirty circles at 50 Hz with currents, a minute to record",
    ("docs/diagnosis.md", "dbbstation diagnose measured"): "the session of the demonstration, as in the README",
    ("docs/drive.md", "dbbstation identify emps.csv"): "a recording that is not ours to give; see test_drive_real.py",
    (
        "docs/getting-started.md",
        "dbbstation instrument emulate",
    ): "a machine that runs until it is stopped; its port changes",
    ("docs/getting-started.md", "dbbstation measure"): "thirty circles at ten times real speed, four minutes",
    ("docs/getting-started.md", "dbbstation calibrate recorded"): "the session that took four minutes",
    ("docs/getting-started.md", "dbbstation predict"): "the model of that session",
    ("docs/getting-started.md", "cat in.csv"): "an input that the reader writes",
    ("docs/getting-started.md", "cat out.csv"): "the answer of that model",
    ("docs/getting-started.md", "dbbstation program"): "the model of that session",
    (
        "docs/gravity.md",
        "python -m studies gravity",
    ): "sixty machines, minutes; see tests/studies/test_gravity_study.py",
}
"""Commands whose output is shown and not compared, by document and beginning of the line, with the reason."""

SLOW = {
    ("README.md", "dbbstation mismatch fixtures/tables/axis.csv"),
    ("docs/compare.md", "dbbstation compare before after"),
    ("docs/diagnosis.md", "python -m studies concealed-gravity"),
    ("docs/mismatch.md", "dbbstation mismatch fixtures/tables/axis.csv"),
    ("docs/mismatch-simulator.md", "dbbstation mismatch fixtures/simulators/pendulum.csv"),
}
"""Those that take about ten seconds."""


@dataclass
class Command:
    """One line after a dollar sign, and what is shown of its output."""

    document: str
    number: int
    text: str
    shown: list[str] = field(default_factory=list)

    @property
    def kind(self) -> tuple[str, str]:
        keys = (key for key in (*EXEMPT, *SLOW) if key[0] == self.document and self.text.startswith(key[1]))
        return next(keys, (self.document, self.text))

    def __str__(self) -> str:
        return f"{self.document}:{self.number}"


def commands_of(document: str) -> list[Command]:
    found: list[Command] = []
    in_block, continued = False, False
    for number, line in enumerate((HERE / document).read_text(encoding="utf-8").splitlines(), start=1):
        if line.startswith("```"):
            in_block = not in_block and line == "```console"
            continued = False
        elif in_block and line.startswith("$ "):
            found.append(Command(document, number, line[2:].removesuffix("\\")))
            continued = line.endswith("\\")
        elif in_block and continued:
            found[-1].text += line.removeprefix(">").strip().removesuffix("\\") + " "
            continued = line.endswith("\\")
        elif in_block and found:
            found[-1].shown.append(line)
    return found


def lines_of(document: str) -> list[Command]:
    found: list[Command] = []
    in_block, continued = False, False
    for number, line in enumerate((HERE / document).read_text(encoding="utf-8").splitlines(), start=1):
        bare = line.strip()
        if bare.startswith("```"):
            in_block = not in_block and bare in {"```", "```sh"}
            continued = False
        elif in_block and continued:
            found[-1].text += " " + bare.removesuffix("\\")
            continued = bare.endswith("\\")
        elif in_block and bare.startswith("dbbstation "):
            # What stands beside it, two spaces on, is its explanation.
            found.append(Command(document, number, bare.partition("   ")[0].removesuffix("\\")))
            continued = bare.endswith("\\")
    return found


COMMANDS = [command for document in DOCUMENTS for command in commands_of(document)]
LINES = [command for document in DOCUMENTS for command in lines_of(document)]
COMPARED = [command for command in COMMANDS if command.shown and command.kind not in EXEMPT]


def words_of(command: Command) -> list[str]:
    return shlex.split(command.text.partition(" > ")[0], comments=True)


def is_alike(shown: str, printed: str) -> bool:
    if shown.endswith(ANYTHING):
        shown = shown.removesuffix(ANYTHING).rstrip()
        printed = " ".join(printed.split()[: len(shown.split())])
    ours, theirs = shown.split(), printed.split()
    return len(ours) == len(theirs) and all(map(_same, ours, theirs))


def _same(one: str, other: str) -> bool:
    if one == other:
        return True
    number = re.compile(r"[+-]?\d+(?:\.(\d+))?")
    if number.sub("#", one) != number.sub("#", other):
        return False
    for a, b in zip(number.finditer(one), number.finditer(other), strict=True):
        unit = 10.0 ** -len(a[1] or "")
        if abs(float(a[0]) - float(b[0])) > max(1.01 * unit, 0.01 * abs(float(a[0]))):
            return False
    return True


def is_shown_by(shown: list[str], printed: list[str]) -> bool:
    if not shown:
        return not printed
    if shown[0] == ANYTHING:
        return any(is_shown_by(shown[1:], printed[k:]) for k in range(len(printed) + 1))
    return bool(printed) and is_alike(shown[0], printed[0]) and is_shown_by(shown[1:], printed[1:])


@pytest.fixture(scope="module")
def workshop(tmp_path_factory):
    """A folder with what the examples find in a checkout, and files that the documents speak of."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("fixtures", "protocols"):
        (folder / name).symlink_to(shipped_folder(name))
    (folder / "docs" / "images").mkdir(parents=True)
    machine = re.search(
        r"^```yaml\n(format: dbb-machine/1\n.*?)^```", MACHINE.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    assert machine
    (folder / "our-machine.yaml").write_text(machine[1], encoding="utf-8")
    shutil.copy(shipped_folder("fixtures") / "machines" / "reference.yaml", folder / "machine.yaml")
    plan = (shipped_folder("protocols") / "plans" / "table2-elevated.yaml").read_text("utf-8").splitlines()
    second = next(k for k, line in enumerate(plan) if "{name: b," in line)
    plan[second] = plan[second].replace("elevation_deg", "elevaton_deg")
    (folder / "plan.yaml").write_text("\n".join(plan) + "\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        computed_once(tmp_path_factory, patch, *OF_TABLES, *STUDIES)
        yield Workshop(folder)


class Workshop:
    """Where commands of the documents are run, each once: what one writes, the next ones of its page read.

    Tests of one page may run in several processes, and in any order.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._outcomes: dict[str, Outcome] = {}

    def outcome_of(self, command: Command) -> Outcome:
        page = [one for one in COMPARED if one.document == command.document and one.number <= command.number]
        for one in page:
            if str(one) not in self._outcomes and (one is command or one.kind not in SLOW):
                with pytest.MonkeyPatch.context() as patch:
                    self._outcomes[str(one)] = self._run(words_of(one), patch)
        return self._outcomes[str(command)]

    def _run(self, words: list[str], patch: pytest.MonkeyPatch) -> Outcome:
        patch.chdir(self.folder)
        words = ["dbbstation", "study", *words[3:]] if words[:3] == ["python", "-m", "studies"] else words
        assert words[0] == "dbbstation"
        if words[1:4] == ["compare", "before", "after"]:
            record_before_and_after(self.folder)
        if words[1:3] == ["history", "sessions"]:
            sessions_over_time(self.folder / "sessions", 16, seed=1, step_at=13, step_um=8.0)
            patch.setenv("XDG_CACHE_HOME", str(self.folder / "cache"))
        return call(*words[1:])


def record_before_and_after(folder: Path) -> None:
    """Two sessions of one machine, balls put up anew; in the second strut 3 is 3 µm longer."""
    rng = np.random.default_rng(3)
    length_mm, base_mm = rng.normal(0, 0.05, 6), rng.normal(0, 0.1, (6, 3))
    for name, seed, longer_mm in (("before", 1, 0.0), ("after", 2, 0.003)):
        errors = Kinematics(length_mm=length_mm + np.array([0, 0, longer_mm, 0, 0, 0]), base_mm=base_mm)
        record(folder / name, seed=seed, plan=subset(table_ii_plan(1), EIGHT), mechanisms=[errors], rate_hz=50.0)


@pytest.mark.parametrize(
    "command",
    [pytest.param(c, id=str(c), marks=[pytest.mark.slow] if c.kind in SLOW else []) for c in COMPARED],
)
def test_a_command_prints_what_is_shown(command, workshop):
    outcome = workshop.outcome_of(command)
    # On a terminal both streams are seen; which comes first depends on the command.
    printed = [outcome.out, outcome.err + outcome.out, outcome.out + outcome.err]
    assert any(is_shown_by(command.shown, one.splitlines()) for one in printed), "\n".join(printed)


@pytest.mark.parametrize("command", [pytest.param(c, id=str(c)) for c in COMMANDS + LINES])
def test_a_command_exists_with_its_options(command):
    words = words_of(command)
    if words[0] == "dbbstation":
        group, context = cli, click.Context(cli, info_name="dbbstation")
        while isinstance(group, click.Group):
            name, *words = words[1:] if words[0] == "dbbstation" else words
            group = group.get_command(context, name)
            assert group is not None, name
        # The parser refuses what the command does not know; it opens no file and asks for none.
        parser = group.make_parser(click.Context(group, info_name=group.name))
        for option in cli.params:  # they may stand anywhere on the line
            parser.add_option(option, option.opts, option.name, nargs=0 if option.is_flag else 1)
        _, left, _ = parser.parse_args([word for word in words if word != ANYTHING])
        takes = sum(1 if one.nargs > 0 else len(words) for one in group.params if isinstance(one, click.Argument))
        assert len(left) <= takes, f"{group.name} takes no {left}"
    elif words[:2] == ["python", "-m"]:
        place = HERE.joinpath(*words[2].split("."))
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists()
    elif words[0] == "python":
        assert (HERE / words[1]).exists()
    else:
        assert words[0] == "cat"


def test_diagnoses_that_are_not_run_are_shown_in_the_words_of_the_command(capsys):
    source = SourceFinding(
        name="gravity",
        verdict=Verdict.IDENTIFIED,
        ambiguous_with=(),
        probability=1.0,
        concealed=0.9,
        gain=9.0,
        stability=1.0,
        text="",
    )
    both = BeforeAfter(2.0, 1.0)
    print_diagnosis(
        DiagnosisFigures(
            mismatch=True,
            probability=0.0,
            noise_um=0.5,
            misfit_rms_um=2.0,
            residual_rms_um=both,
            held_out_rms_um=both,
            held_out_normalised=both,
            held_out="tested",
            held_out_worse=False,
            circularity_um=(),
            workspace=None,
            outliers=(),
            locations=(),
            sources=(source,),
            cancelling=None,
            unexplained=Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise."),
            parameter_shift=(Shift("joint", 0.0, 1.0, 1.0, 0.1),),
            second_start_agrees=True,
            next_test=None,
            further_tests=(),
            levels=Levels(DifferenceFound(Differs.YES, "", 1.0, 2.0, False, 100.0, ()), (), None),  # noqa: FBT003
        )
    )
    printed = {_without_numbers(line) for line in capsys.readouterr().out.splitlines()}
    beginnings = (
        "Measured circles",
        "The recordings",
        "cause ",
        "value ±",
        "residual ",
        "error of ",
        "bias of ",
        "Nothing ",
    )
    for document, least in (("README.md", 2), ("docs/diagnosis.md", 7)):
        shown = [c.shown for c in COMMANDS if c.kind == (document, "dbbstation diagnose measured")]
        lines = [line for block in shown for line in block if line.startswith(beginnings)]
        assert len(lines) >= least
        assert {_without_numbers(line) for line in lines} <= printed


def _without_numbers(line: str) -> str:
    return " ".join(re.sub(r"\d+(\.\d+)?(e-\d+)?", "#", line).split())


def test_every_exemption_is_one():
    shown = {command.kind for command in COMMANDS if command.shown}
    assert set(EXEMPT) <= shown
    assert shown >= SLOW


def test_the_comparison_sees_what_differs():
    printed = ["a  1.0", "b  2.0", "c  3.0"]
    assert is_shown_by(["a 1.0", ANYTHING, "c 3.1"], printed)
    assert is_shown_by([ANYTHING, "b 2.0", ANYTHING], printed)
    assert not is_shown_by(["a 1.0", "c 3.0"], printed)
    assert not is_shown_by(["a 1.0", ANYTHING, "c 3.2"], printed)
    assert not is_shown_by(["a 1.0", "b 2.0"], printed)
    assert not is_shown_by(["a 1.0", "b two", "c 3.0"], printed)
    assert is_alike("said of it …", "said of it and more")
    assert not is_alike("said of it …", "said of her and more")
