"""Help is quick, complete, and its examples are true."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys

import click
import pytest

from dbbstation.cli import COMMANDS, DONE, cli
from dbbstation.cli.control import control
from dbbstation.cli.instruments import TABLE
from dbbstation.cli.jig import jig
from dbbstation.cli.session import session
from studies.__main__ import STUDIES, study

HEAVY = ("numba", "scipy", "rich", "textual", "matplotlib", "pydantic", "numpy")


GROUPS = {
    "study": STUDIES,
    "session": session.commands,
    "jig": jig.commands,
    "instrument": TABLE,
    "control": control.commands,
}
COMMAND = r"(?:dbbstation|python -m studies) "

LINES = [name for name in sorted(COMMANDS) if name not in GROUPS]
LINES += [f"{group} {name}" for group, names in GROUPS.items() for name in sorted(names)]
"""Everything that can be called."""


@pytest.fixture(params=LINES)
def line(request):
    return request.param.split()


@pytest.fixture
def command(line):
    return found(line)[0]


def found(words):
    group, context = cli, click.Context(cli, info_name="dbbstation")
    if words[0] == "study":
        group, words = study, words[1:]
    while isinstance(group, click.Group):
        name, *words = words
        group = group.get_command(context, name)
        assert group is not None, name
    return group, words


def examples(text):
    joined = re.sub(r"\\\n\s*", "", text)
    return [line.strip() for line in joined.splitlines() if re.match(COMMAND, line.strip())]


def test_each_command_has_help_with_an_example(run, line):
    outcome = run(*line, "--help")
    assert (outcome.code, outcome.err) == (DONE, "")
    assert re.match(f"Usage: {COMMAND}{line[-1] if line[0] == 'study' else ' '.join(line)}", outcome.out)
    assert re.search(r"^  Examples?:$", outcome.out, re.MULTILINE)
    assert r"\b" not in outcome.out
    assert examples(outcome.out)


def test_examples_use_options_that_exist(command):
    for example in examples(command.help):
        # Comments and placeholders are for people.
        line = re.sub(r"   \(.*\)$| > .*$", "", example).replace("python -m studies", "dbbstation study")
        words = [word for word in shlex.split(line)[1:] if word != "..."]
        known, arguments = found(words)
        known.make_context(known.name, arguments, resilient_parsing=True)


def test_each_command_says_in_one_line_what_it_does(run):
    outcome = run("--help")
    assert outcome.code == DONE
    for name, text in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(text)}$", outcome.out, re.MULTILINE)


def test_each_option_says_what_it_is_for(command):
    bare = [p.name for p in command.params if isinstance(p, click.Option) and not p.help]
    assert bare == []


def test_one_flag_has_one_text():
    texts = {}
    for line in (line for line in LINES if not line.startswith("study")):
        for option in found(line.split())[0].params:
            if isinstance(option, click.Option):
                texts.setdefault(option.opts[0], {}).setdefault(option.help, []).append(line)
    assert {flag: told for flag, told in texts.items() if len(told) > 1} == {}


def test_results_have_a_json_form(command):
    if command.name not in {"simulate", "demo"}:  # these write recordings, tell a story
        assert "--json" in {option for parameter in command.params for option in parameter.opts}


@pytest.mark.parametrize("arguments", [["--help"], ["calibrate", "--help"], ["--version"], ["evaluate"]])
def test_help_waits_for_no_library(arguments):
    script = (
        "import sys\n"
        "from dbbstation.cli import main\n"
        "try:\n"
        f"    main({arguments!r})\n"
        "except SystemExit:\n"
        f"    print('loaded:', *[name for name in {HEAVY!r} if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines()[-1].strip() == "loaded:"


def test_without_a_command_the_help_is_shown(run):
    outcome = run()
    assert outcome.code in {DONE, 2}
    assert "Start here:" in outcome.out + outcome.err
