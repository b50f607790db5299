"""What messages advise exists: every option and command that a text of the package names is parsed by the command line."""

from __future__ import annotations

import ast
import functools
import re
import shlex
from pathlib import Path

import click
import pytest

import dbbstation
from dbbstation.cli import cli
from tests.cli.test_help import LINES, found

PACKAGE = Path(dbbstation.__file__).parent
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+(?![\w-])")
ADVISES = re.compile(r"--[a-z]|`dbbstation ")
"""In every text that names an option or a command."""

COMMAND = re.compile(r"`dbbstation ([a-z][^`]*)`")

OF_READERS = {
    "files/recordings/foreign_csv.py": ["import", "jig sheet", "jig holders"],
    "files/recordings/cmm_sheet.py": ["jig sheet"],
    "files/recordings/table_csv.py": ["mismatch", "predict"],
    "files/formats/number_language.py": ["mismatch", "predict", "import", "jig sheet"],
    "report/html.py": ["report"],
    "simulators/allowed.py": ["mismatch"],
    "simulators/running.py": ["mismatch"],
}
"""Files whose messages several commands print, with those commands: each has all options that they advise."""

OTHERS = {"--require-hashes", "--no-index", "--find-links", "--headless", "--editable", "--install", "--nthreads"}
OTHERS |= {"--reuid", "--regid", "--clear-groups"}  # of setpriv
"""Options of other programs."""


@functools.cache  # both tests ask for the texts of all files
def texts(path: Path) -> list[tuple[int, str]]:
    """Texts of a file that advises something, with their lines; f-strings with `X` for what is filled in; no docstrings but those of commands."""
    source = path.read_text(encoding="utf-8")
    told: list[tuple[int, str]] = []
    if ADVISES.search(source) is None:
        return told
    inner: set[int] = set()
    for node in ast.walk(ast.parse(source)):  # an f-string before its parts
        if isinstance(node, ast.JoinedStr):
            inner.update(map(id, ast.walk(node)))
            parts = [one.value if isinstance(one, ast.Constant) else "X" for one in node.values]
            told.append((node.lineno, "".join(map(str, parts))))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner:
            told.append((node.lineno, node.value))
    return told


def options(line: str) -> set[str]:
    command, _ = found(line.split())
    return {name for one in command.params for name in (*one.opts, *one.secondary_opts)} | {
        "--help",
        "--debug",
        "--settings",
    }


EVERY = {name for line in LINES for name in options(line)} | {
    n for p in cli.params for n in (*p.opts, *p.secondary_opts)
}
FILES = sorted(PACKAGE.rglob("*.py"))


def test_every_option_that_a_text_names_exists():
    named = [
        (f"{path.relative_to(PACKAGE)}:{line}", option)
        for path in FILES
        for line, text in texts(path)
        for option in OPTION.findall(text)
    ]
    assert len(named) > 300
    assert [
        one for one in named if one[1] not in EVERY | OTHERS and not one[0].startswith(("report/html", "cli/lazy"))
    ] == []


@pytest.mark.parametrize("file", OF_READERS)
def test_what_a_reader_advises_exists_in_each_command_that_reads_with_it(file):
    named = {option for _, text in texts(PACKAGE / file) for option in OPTION.findall(text)}
    named -= {one for one in named if one in {"--headless", "--disable-gpu", "--no-pdf-header-footer", "--no-sandbox"}}
    named -= {"--user-data-dir", "--print-to-pdf"}
    for line in OF_READERS[file]:
        assert named - options(line) == set(), line


def test_every_command_that_a_text_names_is_parsed():
    tried = 0
    for path in FILES:
        for line, text in texts(path):
            for words in COMMAND.findall(text):
                if "..." in words or "…" in words:
                    continue
                tried += 1
                given = shlex.split(words)
                if (
                    given[-1:]
                    and isinstance(cli.get_command(click.Context(cli), given[0]), click.Group)
                    and not given[1:]
                ):
                    continue  # a group by its name
                command, arguments = found(given)
                try:
                    command.make_context(command.name, arguments, resilient_parsing=True)
                except click.UsageError as error:
                    pytest.fail(f"{path.relative_to(PACKAGE)}:{line}: `dbbstation {words}`: {error.message}")
    assert tried > 20
