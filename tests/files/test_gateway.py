"""One way in for every file: regular files only, counted as they are read; and nobody goes round it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dbbstation.files import gateway
from dbbstation.files.gateway import NotRegularError, TooLargeError, content_of, digest_of, head_of, opened
from dbbstation.files.source_text import LONGEST_LINE, first_line
from dbbstation.files.yaml import text as yaml_text
from dbbstation.files.yaml.text import load_yaml
from tests.cli.conftest import call
from tests.parsed import trees_with

ROUND_IT = {
    "cli/log.py": "writes the log, opened for its owner alone",
    "files/gateway.py": "is the gateway",
    "files/atomic.py": "opens its own files to write them",
    "system/handles.py": "opens files for those who ask the gateway, and those that are changed in place",
    "system/replacing.py": "opens folders to write them to disk",
    "files/recordings/journal.py": "creates the file that it writes",
    "system/ports.py": "asks the system in /proc who holds a port, and reads the mark that it wrote beside one",
    "system/mounts.py": "asks the system in /proc what is mounted",
    "cli/settings.py": "reads a file of the package",
    "report/html.py": "reads a file of the package, and what the browser has just printed",
    "files/places.py": "reads a file of the package",
    "simulators/program.py": "creates the file that it writes",
}
"""Files that open files themselves, each with its reason."""


OPEN, READ = {"open", "open_to_read"}, {"read_bytes", "read_text", "fromfile", "memmap"}


def opens_files(tree: ast.AST) -> list[int]:
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        if isinstance(called, ast.Name) and called.id in OPEN:
            found.append(node.lineno)
        elif isinstance(called, ast.Attribute):
            named = isinstance(called.value, ast.Name) and called.value.id in {"os", "io", "codecs", "gzip"}
            # Ports, links and screens are opened without a mode, or with words for it.
            mode = [
                arg.value
                for arg in [*node.args, *(word.value for word in node.keywords)]
                if isinstance(arg, ast.Constant)
            ]
            of_path = called.attr == "open" and any(
                isinstance(value, str) and set(value) <= set("rwxab+t") for value in mode
            )
            if called.attr in READ or (called.attr == "open" and (named or of_path)):
                found.append(node.lineno)
    return found


def test_nobody_reads_a_file_round_the_gateway():
    found = {name: lines for name, tree in trees_with(OPEN | READ) if (lines := opens_files(tree))}
    # Our own `read_bytes` is a function, no method.
    assert {name: lines for name, lines in found.items() if name not in ROUND_IT} == {}
    assert set(ROUND_IT) - set(found) == set()


def test_the_search_for_ways_round_finds_them():
    ways = [
        "open(p)",
        "p.open('rb')",
        "p.open(mode='r')",
        "p.read_text()",
        "os.open(p, 0)",
        "io.open(p)",
        "np.fromfile(p)",
    ]
    assert [opens_files(ast.parse(way)) for way in ways] == [[1]] * len(ways)
    assert (
        opens_files(
            ast.parse(
                "path.open('w' if force else 'x')\nport.open()\nfront.open(choice, prepared)\nread_bytes(p, faults)"
            )
        )
        == []
    )


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("read", [content_of, digest_of, first_line, lambda path: head_of(path, 10)])
def test_a_pipe_is_not_waited_for_and_a_device_not_read(pipe, read):
    began = time.monotonic()
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(NotRegularError):
            read(path)
    assert time.monotonic() - began < 10.0


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(tmp_path, pipe, monkeypatch):
    file = tmp_path / "file"
    file.write_bytes(b"x")
    monkeypatch.setattr(gateway, "_stat", lambda _path: file.stat())
    with pytest.raises(NotRegularError):
        content_of(pipe)


@pytest.mark.parametrize(
    "line",
    [
        ["check"],
        ["instrument", "replay"],
        ["mismatch", "--measured", "a", "--simulated", "b"],
        ["identify"],
        ["jig"],
        ["evaluate", "--model"],
        ["sources", "--source-files"],
        ["--settings"],
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("name", ["pipe.csv", "pipe.yaml"])
def test_no_command_waits_for_a_pipe(tmp_path, line, name):
    os.mkfifo(tmp_path / name)
    command = [*line, tmp_path / name] if line != ["--settings"] else [*line, tmp_path / name, "settings"]
    outcome = call(*command)
    assert outcome.code != 0
    assert "fault of dbbstation" not in outcome.err


def test_a_device_is_no_byte_log():
    outcome = call("instrument", "replay", "/dev/zero")
    assert outcome.code == 1
    assert outcome.err == "/dev/zero: this is a pipe or a device: name a file; write it to a file first\n"


def test_a_file_that_grows_while_it_is_read_is_counted(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * 10)
    with opened(path, largest=20) as source:
        path.write_bytes(b"x" * 30)
        with pytest.raises(TooLargeError, match="is longer than 20 bytes"):
            source.content()
    with pytest.raises(TooLargeError, match="has 30 bytes, at most 20 are read"):
        content_of(path, 20)
    assert content_of(path, 30) == b"x" * 30


@pytest.mark.parametrize("name", ["\0", "\ud800"])
def test_a_name_that_no_file_can_have_is_that_of_no_file(tmp_path, name):
    with pytest.raises(FileNotFoundError):
        content_of(tmp_path / name)


def test_a_first_line_without_an_end_is_not_read_to_it(tmp_path):
    path = tmp_path / "file"
    with path.open("wb") as file:
        file.truncate(100 * LONGEST_LINE)  # zeros, that take no room
    assert len(first_line(path)) <= 2 * LONGEST_LINE


TEN_MILLION = """
import resource, sys
from pathlib import Path
from dbbstation.files.recordings.run_csv import read_run
def kib(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
read_run(Path(sys.argv[1]))
before = kib()
run = read_run(Path(sys.argv[2]))
print(1024 * (kib() - before) / len(run.recording), len(run.recording))
"""


def rows(count: int) -> str:
    return "t_s,length_mm\n" + "".join(f"{i / 1e4:.4f},{150 + i % 97 / 1e4:.6f}\n" for i in range(count))


def test_a_long_run_takes_sixty_bytes_a_sample(tmp_path):
    """Half a million samples here; ten million took 36 bytes each."""
    for name, count in (("short.csv", 1000), ("long.csv", 500_000)):
        (tmp_path / name).write_text(rows(count), encoding="ascii")
    command = [sys.executable, "-c", TEN_MILLION, tmp_path / "short.csv", tmp_path / "long.csv"]
    each, count = subprocess.run(command, capture_output=True, check=True, text=True).stdout.split()
    assert int(count) == 500_000
    assert float(each) < 60.0


def said_of(tmp_path, text):
    path, faults = tmp_path / "file.yaml", []
    path.write_text(text, encoding="utf-8")
    load_yaml(path, faults)
    return faults


def test_keys_and_values_are_counted_before_they_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(yaml_text, "MOST_NODES", 100)
    assert said_of(tmp_path, "a:\n" + "- 1\n" * 97) == []
    (fault,) = said_of(tmp_path, "a:\n" + "- 1\n" * 98)
    assert (fault.line, fault.column, fault.what) == (99, 3, "there are more than 100 keys and values")


def test_depth_is_counted(tmp_path):
    inner = yaml_text.DEEPEST - 2
    assert said_of(tmp_path, "a: " + "[" * inner + "1" + "]" * inner) == []
    (fault,) = said_of(tmp_path, "a: " + "[" * (inner + 1) + "1" + "]" * (inner + 1))
    assert (fault.line, fault.column) == (1, 4 + inner + 1)


def test_time_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(yaml_text, "LONGEST_S", -1.0)
    assert "took -1 s" in said_of(tmp_path, "late: 1")[0].what


def test_very_many_unknown_keys_are_counted_quickly(tmp_path):
    """Naming what each may have been meant for took two minutes for 100,000."""
    path = tmp_path / "plan.yaml"
    count = 3000
    path.write_text("format: dbb-plan/1\nname: x\n" + "".join(f"key{i}: {i}\n" for i in range(count)), encoding="utf-8")
    began = time.process_time()
    outcome = call("check", path)
    assert time.process_time() - began < 30.0
    assert outcome.code == 1
    told = outcome.out + outcome.err
    assert f"{path}:21:1: and {count - 18} more of these from here on" in told
    assert len(told) < 10_000


def test_a_long_name_is_not_echoed(tmp_path):
    path = tmp_path / "plan.yaml"
    long = "x" * 200_000
    for text in (f"{long}: 1", f"format: dbb-plan/1\nname: [{long}]", f"a: !{long} 1"):
        path.write_text(text + "\n", encoding="utf-8")
        outcome = call("check", path)
        assert outcome.code == 1
        assert len(outcome.out + outcome.err) < 3000


@pytest.mark.parametrize(
    ("name", "size", "line"),
    [
        ("plan.yaml", 10_000_001, ["check"]),
        ("drive.csv", 200_000_001, ["identify"]),
        ("table.csv", 200_000_001, ["mismatch", "--measured", "a", "--simulated", "b"]),
        ("sheet.dmo", 20_000_001, ["jig", "sheet", "--jig", "j.yaml", "--u-um", "1", "--out", "o.yaml"]),
        ("own.py", 1_000_001, ["sources", "--source-files"]),
        ("run.csv", 2_000_000_001, ["check"]),
    ],
)
def test_a_file_beyond_its_budget_is_refused_unread(tmp_path, monkeypatch, name, size, line):
    monkeypatch.chdir(tmp_path)
    jig = Path(__file__).parents[2] / "fixtures" / "jigs" / "reference-plate.yaml"
    (tmp_path / "j.yaml").write_bytes(jig.read_bytes())
    with (tmp_path / name).open("wb") as file:
        file.truncate(size)  # zeros, that take no room
    began = time.process_time()
    outcome = call(*line, name)
    assert outcome.code == 1
    assert f"{name}: the file has {size:,} bytes, at most {size - 1:,} are read" in outcome.err
    assert time.process_time() - began < 10.0
