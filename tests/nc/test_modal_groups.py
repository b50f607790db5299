"""Every pair of G and M words in one line: what LinuxCNC refuses as two of one group is refused here."""

from __future__ import annotations

import os
import subprocess
from itertools import combinations, pairwise

import pytest

from dbbstation.errors import InputError
from dbbstation.nc.rs274.blocks import G_CODES, M_CODES, block_of, name
from dbbstation.nc.rs274.tokens import BadLine, Place
from tests.nc.interpreter import RS274, needs_rs274

OTHERS = {5.0, 5.1}
"""Curves for LinuxCNC, and smoothing for controls that have it beside a motion."""

WORDS = [name("G", code) for code in sorted(G_CODES) if code not in OTHERS]
WORDS += [name("M", code) for code in sorted(M_CODES) if code <= 102]

FIRST = "G21 G90 G94 G98\nG0 X0 Y0 Z-1000 A0 B0 C0\n"


def refused_by_linuxcnc(lines: list[str], folder) -> set[str]:
    """The lines with two codes of one group; it goes on behind each fault."""
    (folder / "tool.tbl").write_text("T1 P1 D0.1 Z0\n")
    (folder / "rs274.var").touch()
    (folder / "program.ngc").write_text("\n".join([*lines, "M2"]) + "\n")
    done = subprocess.run(
        [RS274, "-g", "-n", "0", "-t", "tool.tbl", "-v", "rs274.var", "program.ngc"],
        cwd=folder,
        env=os.environ | {"HOME": str(folder)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    said = (done.stdout + done.stderr).splitlines()
    return {line for what, line in pairwise(said) if "used from same modal group" in what}


def refused_here(line: str) -> bool:
    try:
        block_of(line, Place("part.ngc", 1))
    except BadLine as error:
        return "exclude each other" in error.problem.what
    return False


@needs_rs274
def test_two_codes_of_one_group_of_linuxcnc_are_refused(tmp_path):
    pairs = [f"{one} {other}" for one, other in combinations(WORDS, 2)]
    # A subprogram's return, or the end of the program, ends the run.
    leaves = {"M2", "M30", "M98", "M99"}
    lines = [line for line in pairs if not leaves & set(line.split())]
    theirs = refused_by_linuxcnc(lines, tmp_path)
    assert len(theirs) > 200
    assert {line for line in theirs if not refused_here(line)} == set()


@pytest.mark.parametrize(
    ("line", "column", "what"),
    [
        ("M48 M50", 5, "M50 and M48 exclude each other"),
        ("M52 P1 M49", 8, "M49 and M52 exclude each other"),
        ("M3 M70", 4, "M70 and M3 exclude each other"),
        ("M0 M98 P1", 4, "M98 and M0 exclude each other"),
        ("M62", 1, "M62 needs P"),
        ("M67 Q1", 1, "M67 needs E"),
        ("G92", 1, "G92 without axes"),
        ("G41 D1 G54", 8, "beside a contour"),
        ("G42 G28", 5, "beside a contour"),
    ],
)
def test_what_linuxcnc_refuses_in_one_line_is_refused_with_its_place(linuxcnc, line, column, what):
    with pytest.raises(InputError, match=rf":3:{column}: {what}"):
        linuxcnc.read(f"{FIRST}{line}\nG1 X1 F100\nM2\n", "part.ngc")
