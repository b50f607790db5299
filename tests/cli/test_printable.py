"""What other people typed gives no orders: not to the terminal that shows it, not to the spreadsheet that opens it."""

from __future__ import annotations

import ast
import contextlib
import csv
import io
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from dbbstation.files.csv_rows import csv_text
from dbbstation.files.places import shipped_folder
from dbbstation.text.written import on_one_line, printable
from tests.cli.conftest import call
from tests.fuzz.seeds import SEEDS
from tests.fuzz.worker import place
from tests.parsed import trees_with

TITLE = "\x1b]0;owned\x07"
FORMULA = "=HYPERLINK(1)"

PRINT = {
    "cli/output.py": "is the one way out",
    "cli/asking.py": "asks, with escaped questions",
    "cli/import_.py": "asks, with an escaped question",
    "service/worker.py": "tells the station, which escapes what it shows",
}
"""Files that write to a terminal themselves, each with its reason."""

TABLES = {
    "files/csv_rows.py": "is the one writer",
    "files/recordings/journal.py": "writes runs, whose columns are numbers and words of the program",
    "files/recordings/run_lines.py": "names the program's own columns in a message",
    "files/recordings/drive_csv.py": "writes numbers under the program's own names",
    "nc/dialects/poses.py": "writes numbers under the program's own names; its comments go through `plain`",
    "files/recordings/foreign_csv.py": "parts a line that it reads, and writes none",
    "simulators/program.py": "writes numbers for a program, which reads them as they are",
}
"""Files that write CSV themselves, each with its reason."""


OF_CLICK = {"echo", "secho", "prompt", "confirm", "progressbar", "echo_via_pager", "style"}
OF_STREAMS = {"write", "writelines", "buffer"}
WRITE = {f"click.{name}" for name in OF_CLICK} | {
    f"sys.{stream}.{name}" for stream in ("stdout", "stderr") for name in OF_STREAMS
}


def prints(tree: ast.AST) -> list[int]:
    """Lines that write to a terminal: `print`, functions of click, and the streams."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in OF_CLICK | OF_STREAMS and ast.unparse(node) in WRITE:
            found.append(node.lineno)
        if isinstance(node, ast.Name) and node.id == "print":
            found.append(node.lineno)
    return sorted(found)


OF_TABLES = {"writer", "DictWriter", "savetxt"}


def writes_tables(tree: ast.AST) -> list[int]:
    """Lines that write CSV: its module, NumPy's function, and cells joined by a separator."""
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        if node.attr in OF_TABLES and ast.unparse(node) in {"csv.writer", "csv.DictWriter", "np.savetxt"}:
            found.append(node.lineno)
        if node.attr == "join" and ast.unparse(node.value) in {"','", "';'", r"'\t'"}:
            found.append(node.lineno)
    return sorted(found)


@pytest.fixture(scope="module")
def found_in_package() -> dict[str, dict[str, list[int]]]:
    """Lines of each file by the search that found them; each file is parsed once."""
    found: dict[str, dict[str, list[int]]] = {search.__name__: {} for search in (prints, writes_tables)}
    for name, tree in trees_with({"print", "join"} | OF_CLICK | OF_STREAMS | OF_TABLES):
        for search in (prints, writes_tables):
            if lines := search(tree):
                found[search.__name__][name] = lines
    return found


@pytest.mark.parametrize(("search", "allowed"), [(prints, PRINT), (writes_tables, TABLES)], ids=["terminal", "tables"])
def test_nobody_goes_round_the_escaper(found_in_package, search, allowed):
    found = found_in_package[search.__name__]
    assert {name: lines for name, lines in found.items() if name not in allowed} == {}
    assert set(allowed) - set(found) == set()


def test_the_searches_find_ways_round():
    assert prints(ast.parse("print(1)\nclick.echo(2)\nsys.stdout.write(3)\nsays = click.secho")) == [1, 2, 3, 4]
    assert writes_tables(ast.parse("csv.writer(f)\n','.join(a)\n', '.join(b)\nnp.savetxt(f, x)")) == [1, 2, 4]


def test_many_of_one_control_are_counted():
    assert on_one_line(f"t_s{chr(0) * 4000}µ") == r"t_s\x00 (4000 times)µ"
    assert (
        printable(f"{chr(0) * 8}{chr(27) * 9}{chr(10) * 20}{'-' * 40}")
        == r"\x00" * 8 + r"\x1b (9 times)" + "\n" * 20 + "-" * 40
    )


def test_controls_are_shown_and_text_stays():
    every = "".join(map(chr, [*range(0xA1), 0x202E, 0x2066, 0x2028, 0xD800]))
    for made in (printable(every), on_one_line(every)):
        assert all(char.isprintable() or char in "\n\t" or char == "\xa0" for char in made)
        made.encode()
    assert printable("a\nb\tµ 測定 é") == "a\nb\tµ 測定 é"
    assert on_one_line("a\nb") == r"a\x0ab"
    assert printable(TITLE) == r"\x1b]0;owned\x07"
    assert printable("\u202eab") == r"\u202eab"


@pytest.mark.parametrize(
    "cell", ["=1+1", "+cmd", "-cmd|x", "@SUM(1)", "\t=1", "\r=1", "＝1", " =1", "-", "-inf", "a", "", "'"]
)
def test_a_text_begins_no_formula(cell):
    (row,) = csv.reader(io.StringIO(csv_text([[cell]]), newline=""))
    assert row[0].endswith(printable(cell))
    assert row[0] == "-" or row[0].strip()[:1] not in set("=+-@＝")


@pytest.mark.parametrize("number", ["-1", "+1.5", "-1e-5", "-.5", "1", -1.0, -3, None])
def test_a_number_stays_a_number(number):
    assert csv_text([[number, "x"]]) == f"{'' if number is None else number},x\n"


def test_sums_of_binary_fractions_are_written_as_people_add():
    assert csv_text([[1500.8 - 1e-12 * 1.9, 0.1 + 0.2, 2.0 / 3.0, 1e-9, np.float64(0.1) * 3]]) == (
        "1500.8,0.3,0.666666666667,1e-09,0.3\n"
    )


@pytest.fixture
def session(tmp_path):
    """A session with orders in the name of its machine, in the names of its columns and in its folder's own name."""
    folder = tmp_path / f"{FORMULA}"
    shutil.copytree(shipped_folder("fixtures") / "sessions" / "small", folder)
    machine = folder / "machine.yaml"
    text = machine.read_text(encoding="utf-8")
    assert "name: " in text
    lines = [f'name: "{FORMULA}\\e]0;owned\\a"' if line.startswith("name: ") else line for line in text.splitlines()]
    machine.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    "line",
    [
        ["check", "{s}/machine.yaml"],
        ["check", "{s}"],
        ["session", "list", "{s}"],
        ["session", "reject", "{s}", "a-ccw-1", "--reason", TITLE],
        ["circles", "{s}"],
        ["history", "{t}"],
        ["check", "{s}/" + TITLE],
        [TITLE],
        ["check", "--" + TITLE],
    ],
    ids=lambda line: ascii(" ".join(line)),
)
def test_no_command_passes_orders_on_to_the_terminal(session, line):
    outcome = call(*(word.format(s=session, t=session.parent) for word in line))
    assert not set("\x1b\x07\x9b") & set(outcome.out + outcome.err)


@pytest.mark.parametrize(
    "line",
    [["history", "{t}", "--table", "{o}"], ["circles", "{s}", "--table", "{o}"], ["export", "{s}", "--out", "{o}"]],
)
def test_no_table_holds_a_formula(session, tmp_path, line):
    out = tmp_path / "out.csv"
    outcome = call(*(word.format(s=session, t=session.parent, o=out) for word in line))
    assert outcome.code == 0, outcome.err
    text = out.read_text(encoding="utf-8")
    assert "HYPERLINK" in text
    cells = [cell for row in csv.reader(io.StringIO(text, newline="")) for cell in row]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "@"))]


FORGED = "no fault at all"
"""What a line begins with that a name has forged."""

_TEXT_OF_A_KEY = re.compile(
    r"(?m)^\s*(?:- )?(?:name|serial_number|operator|job|ball|test): ([^\s#\[{|>\d][^#\n]*?)\s*$"
)


def forged(run_words, folder, files, renamed=()):
    """Lines of both streams that begin with what a name holds behind a line feed."""
    place(files, folder)
    for old, new in renamed:
        (folder / old).rename(folder / new)
    with contextlib.chdir(folder):
        done = call(*run_words)
    return [line for line in (done.out + "\n" + done.err).splitlines() if line.lstrip().startswith(FORGED)]


@pytest.mark.parametrize(
    "kind", ["plan ten-minute-check", "machine reference", "model small", "bar zerodur", "session small"]
)
def test_no_name_in_a_file_makes_a_line_of_its_own(tmp_path, kind):
    seed = next(one for one in SEEDS if one.kind == kind)
    commands = ["check s", "session list s", "history .", "circles s"] if "session" in kind else list(seed.commands)
    tried = 0
    for target in (name for name in seed.targets if name.endswith(".yaml")):
        text = seed.files[target].decode()
        spots = {found[0].split(":")[0]: found for found in _TEXT_OF_A_KEY.finditer(text)}
        for found in spots.values():
            spoilt = f'{text[: found.start(1)]}"x\\n{FORGED}"{text[found.end(1) :]}'
            for line in commands:
                tried += 1
                assert not forged(line.split(), tmp_path / "here", seed.files | {target: spoilt.encode()}), (
                    line,
                    found,
                )
    assert tried


@pytest.mark.parametrize(
    ("kind", "line", "name"),
    [
        ("plan with a machine", "program --plan plan.yaml --machine machine.yaml --out NAME", None),
        ("settings in force", "--settings NAME settings", "file.yaml"),
        ("CMM sheet", "jig sheet s.csv --jig sound/jig.yaml --u-um 0.8 --out NAME", None),
        ("mountings", "jig holders s.csv --jig sound/jig.yaml --out NAME", None),
        ("session small", "export NAME --out NAME.csv", "s"),
        ("session begun", "check NAME", "s"),
        ("session begun", "report NAME --page NAME.html", "s"),
        ("session begun", "evaluate NAME --model sound/model.yaml", "s"),
        ("byte log", "replay NAME", "log.txt"),
        ("table", "mismatch NAME --measured a --simulated b", "t.csv"),
    ],
)
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_no_name_of_a_file_makes_a_line_of_its_own(tmp_path, kind, line, name):
    seed = next(one for one in SEEDS if one.kind == kind)
    new = f"x\n{FORGED}{Path(name).suffix if name else '.yaml'}"
    words = [word.replace("NAME", new) for word in line.split()]
    assert not forged(words, tmp_path / "here", seed.files, [(name, new)] if name else ())
