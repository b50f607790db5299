"""Subprograms in files of their own, tools set by the program, and lines that a switch skips, as LinuxCNC reads them."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.tasks.programs import setup_of
from tests.nc.interpreter import events, needs_rs274
from tests.nc.test_fuzz_rs274 import difference

HEAD = "G21 G90 G94 G17 G40 G49\nG0 X0 Y0 Z-990 A0 B0 C0\n"
DRILL = (
    "o<drill> sub\nG0 X#1 Y#2\no10 repeat [#3]\nG91 G1 Z-1 F120\nG90\no10 endrepeat\nG0 Z-990\no<drill> endsub\nM2\n"
)
PROGRAM = f"{HEAD}o10 repeat [2]\no<drill> call [10] [20] [3]\no<Drill> call [-10] [20] [2]\no10 endrepeat\nM2\n"


@needs_rs274
def test_a_file_in_the_folder_is_called_as_linuxcnc_does(tmp_path):
    (tmp_path / "drill.ngc").write_text(DRILL)
    setup = setup_of({}, {}, subprograms=tmp_path)
    path = read_program(PROGRAM, "part.ngc", start=np.zeros(6), setup=setup)
    assert not difference(path, events(PROGRAM, tmp_path))
    assert path.where(4) == f"{tmp_path / 'drill.ngc'}:4"
    assert path.where(0) == "part.ngc:2"


def test_a_fault_in_a_file_is_told_by_its_own_line(tmp_path):
    (tmp_path / "drill.ngc").write_text(DRILL.replace("G1 Z-1", "G1 Z-1 U3"))
    with pytest.raises(InputError, match=r"drill\.ngc:4:12: words with the letter U"):
        read_program(PROGRAM, "part.ngc", setup=setup_of({}, {}, subprograms=tmp_path))
    with pytest.raises(
        InputError, match=r"part\.ngc:4:1: the subprogram O<drill> is not in this file; .*--subprograms"
    ):
        read_program(PROGRAM, "part.ngc")


@pytest.mark.parametrize("name", ["O0012.nc", "12.nc", "o12"])
def test_m98_finds_a_numbered_file(tmp_path, name):
    (tmp_path / name).write_text("%\nO0012 (STEP)\nG91 G0 X1\nG90\nM99\n%\n")
    setup = setup_of({}, {}, subprograms=tmp_path)
    path = read_program(f"%\nO0001\n{HEAD}M98 P12 L2\nM98 P0012\nM30\n%\n", "main.nc", setup=setup)
    assert path.poses[:, 0].tolist() == [0, 1, 2, 3]


def test_a_file_without_its_end_does_not_run_into_another(tmp_path):
    (tmp_path / "one.ngc").write_text("o<one> sub\nG0 X1\n")
    (tmp_path / "two.ngc").write_text("o<two> sub\nG0 X2\no<two> endsub\n")
    with pytest.raises(InputError, match="ends without"):
        read_program(f"{HEAD}o<two> call\no<one> call\nM2\n", "part.ngc", setup=setup_of({}, {}, subprograms=tmp_path))


@needs_rs274
def test_a_switch_skips_lines_or_does_not(tmp_path):
    text = f"{HEAD}G0 X1\n/G0 X2\n / G0 X3\nG0 X4\nM2\n"
    on, off = (setup_of({}, {}, block_delete=switch) for switch in ("on", "off"))
    path = read_program(text, "part.ngc", start=np.zeros(6), setup=off)
    assert not difference(path, events(text, tmp_path))  # where the switch is off
    assert read_program(text, "part.ngc", setup=on).poses[:, 0].tolist() == [0, 1, 4]
    with pytest.raises(InputError, match=r"part\.ngc:4:1: a line that a switch of the control skips .*--block-delete"):
        read_program(text, "part.ngc")


@needs_rs274
def test_a_tool_that_the_program_sets_has_its_length_and_diameter(tmp_path):
    text = f"{HEAD}T1 M6\nG10 L1 P1 Z12.5 R2\nG43\nG0 Z-980\nG41\nG1 X10 F100\nX20\nG40 X30\nM2\n"
    path = read_program(text, "part.ngc", start=np.zeros(6), setup=ControlSetup())
    assert not difference(path, events(text, tmp_path))
    assert "H1" not in path.holds
    assert "D1" not in path.holds
