"""Long arrays lie in a file: they hold the same, and programs become the same, in memory that does not grow with them."""

from __future__ import annotations

import subprocess
import sys
import tempfile

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.nc import spilled
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274 import lines
from dbbstation.nc.rs274.lines import ProgramLines
from dbbstation.nc.spilled import LongText, Spilled, forget
from dbbstation.tasks.programs import program_of
from tests.nc.grammar import part
from tests.nc.test_long_programs import LINES


@pytest.fixture
def small(monkeypatch):
    """Files from the first byte on, and few bytes at once."""
    monkeypatch.setattr(spilled, "IN_MEMORY_BYTES", 0)
    for module in (spilled, lines):
        monkeypatch.setattr(module, "BLOCK_BYTES", 64)
    monkeypatch.setattr(lines, "STRETCHES", 2)


USES = pytest.mark.usefixtures("small")


def refused(*_args, **_named):
    raise OSError("the disk is full")


@pytest.mark.parametrize("has_room", [True, False])
@pytest.mark.parametrize("kind", [np.uint8, (np.uint64, 2), np.dtype([("a", np.float64, 3), ("b", np.int8)])])
@USES
def test_values_are_those_that_were_added(monkeypatch, kind, has_room):
    if not has_room:
        monkeypatch.setattr(tempfile, "TemporaryFile", refused)
    drawn, array, wanted = np.random.default_rng(7), Spilled(kind), []
    for _ in range(60):
        new = np.zeros(drawn.integers(0, 40), kind)
        new.view(np.uint8)[...] = drawn.integers(0, 99, new.view(np.uint8).shape)
        array.add(new)
        wanted.append(new)
        if len(array) > 3:
            before = array.values[1:3]
            forget(array.values)
            np.testing.assert_array_equal(before, np.concatenate(wanted)[1:3])
    array.take_back()
    assert (array._file is not None) == has_room
    np.testing.assert_array_equal(array.values, np.concatenate(wanted)[:-1])
    np.testing.assert_array_equal(np.concatenate(list(array.blocks())), array.values)


@pytest.mark.parametrize("text", ["", "\n", "a", "\nb\n\n", "Fräser µ\n" * 40, "x" * 200 + "\ny\n", "\ud800\nz"])
@USES
def test_lines_are_those_of_the_text(text):
    wanted, read = text.split("\n"), ProgramLines()
    for _ in range(2):
        found = dict(read.append(LongText.of(text).letters, np.isin(np.arange(256), [ord("y"), ord("b")])))
        assert list(found.values()) == [line for line in wanted if {"y", "b"} & set(line)]
    order = np.random.default_rng(1).permutation(len(read)).tolist()
    assert [read[at] for at in order] == [(wanted + wanted)[at] for at in order]
    assert str(LongText.of(text)) == text


@pytest.mark.parametrize("seed", range(12))
def test_a_program_becomes_the_same(linuxcnc, crooked, request, seed):
    def written() -> str:
        text = part(seed) if seed else LINES
        return compensated_program(linuxcnc.read(text, "part.ngc"), linuxcnc, Inverse(crooked)).text

    in_memory = written()
    request.getfixturevalue("small")
    assert written() == in_memory


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("(µ)\nM2\n".encode("utf-16"), "(µ)\nM2\n"),
        ("(µ)\nM2\n".encode("cp1252"), "(µ)\nM2\n"),
        ("\ufeff(µ)\nM2\n".encode(), "\ufeff(µ)\nM2\n"),
        (b"(" + "µ".encode() * 100 + b")\n" + b"\xb5", "(" + "Âµ" * 100 + ")\nµ"),
        (b"", ""),
    ],
)
@USES
def test_a_file_is_decoded_as_a_whole(tmp_path, data, says):
    """Windows' code page where one byte of the file is not UTF-8."""
    (tmp_path / "part.ngc").write_bytes(data)
    assert str(program_of(tmp_path / "part.ngc")) == says


PEAK = """
import resource, sys
from pathlib import Path
from dbbstation.files.formats.machine import read_machine
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.registry import dialect_named
from dbbstation.nc.spilled import LongText
linuxcnc, model = dialect_named("linuxcnc"), MachineModel(read_machine(Path(sys.argv[1])))
for blocks in map(int, sys.argv[2:]):
    text = LongText([b"G21 G90\\nG0 X0 Y0 Z-1000 A0 B0 C0\\nF600\\n"])
    for k in range(blocks):
        text.add(f"G1 X{k % 1000 / 10:.3f} Y{k // 1000 / 10:.3f}\\n".encode())
    text.add(b"M2\\n")
    compensated_program(linuxcnc.toolpath(text, "long.ngc"), linuxcnc, Inverse(model))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="peak memory is in kilobytes on Linux")
@pytest.mark.slow
def test_memory_does_not_grow_with_the_program():
    """Within a tenth; the rows, the texts and the sums of 160,000 blocks are 32 MB. The peak of a process only grows."""
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    told = subprocess.check_output([sys.executable, "-c", PEAK, str(machine), "20000", "180000"])
    few, many = map(int, told.split())
    print(f"{few} and {many} kB")  # noqa: T201 - with -s
    assert many < 1.1 * few
