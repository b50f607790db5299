"""A compensated program is known by its poses, whatever was done to its text."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dbbstation.errors import StationError
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.dialects.linuxcnc import LinuxCNC
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.mark import BITS, BY_CHANCE, _marks, _sums, is_marked, marked
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import DECIMALS, in_last_decimals
from tests.nc.whole import compensate_toolpath

PART = "G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X20 F500\nG4 P0.5\nG1 Y5 A2\nX7 Y7\nX0 Y9\nX3 Y0\nM0\nG0 Z-950\nM2\n"


def without_numbers(text: str) -> str:
    return re.sub(r"(?m)^N\d+ ", "", text)


def renumbered(text: str) -> str:
    return "".join(f"N{10 * k} {line}\n" for k, line in enumerate(without_numbers(text).splitlines()) if line[0] != ";")


def in_inches(text: str) -> str:
    lines = []
    for line in without_numbers(text).replace("G21", "G20").splitlines():
        if line[0] == "G":
            line = re.sub(r"([XYZ])(-?[\d.]+)", lambda m: f"{m[1]}{float(m[2]) / 25.4:.9f}", line)  # noqa: PLW2901
        lines.append(line)
    return "\n".join(lines) + "\n"


def edited(text: str) -> str:
    """Slower, without its stop, with a move of one's own at the end, and a part taken out."""
    lines = [line for line in without_numbers(text).splitlines() if line[0] != ";"]
    begin = lines.index("G21 G90 G94 G17 G40 G49")
    lines = [*lines[: begin + 5], *(line for line in lines[begin + 6 :] if line != "M0")]
    lines[-1:] = ["G1 X100 F50", "M2"]
    return re.sub(r"F500", "F77", "\n".join(lines) + "\n")


def bare(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if not line.startswith((";", "("))) + "\n"


@pytest.mark.parametrize("change", [without_numbers, renumbered, in_inches, edited])
def test_a_compensated_program_is_known_whatever_its_text(linuxcnc, crooked, change):
    once = compensated_program(read_program(PART, "part.ngc"), linuxcnc, Inverse(crooked)).text
    with pytest.raises(StationError, match="compensated already, say the last decimals"):
        compensated_program(linuxcnc.read(bare(change(once)), "again.ngc"), linuxcnc, Inverse(crooked))


@pytest.mark.parametrize(
    "moves",
    [
        "G1 X20 F500\n",
        "G0 X20\n",
        "G1 X9 F100\nG0 Z-990\n",
        "G54\nG1 X20 F500\nG55 G0 X0 Y0 Z-1000 A0 B0 C0\nG53 G0 Z-950\n",
    ],
)
def test_a_program_of_two_moves_is_known_too(linuxcnc, crooked, moves):
    path = read_program(f"G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\n{moves}M2\n", "part.ngc")
    once = compensated_program(path, linuxcnc, Inverse(crooked)).text
    with pytest.raises(StationError, match="compensated already, say the last decimals"):
        compensated_program(linuxcnc.read(bare(without_numbers(once)), "again.ngc"), linuxcnc, Inverse(crooked))


def test_a_compensated_circle_is_known_without_numbers(linuxcnc, crooked, table2):
    (program, _) = circle_programs(table2, crooked.machine, linuxcnc, inverse=Inverse(crooked), tests=["a"])
    with pytest.raises(StationError, match="compensated already"):
        compensated_program(linuxcnc.read(bare(without_numbers(program.text)), "a.ngc"), linuxcnc, Inverse(crooked))


class Coarse(LinuxCNC):
    """A control that takes four decimals."""

    decimals = (4, 4, 4, 4, 4, 4)


@pytest.mark.parametrize("change", [lambda text: text, lambda text: bare(without_numbers(text))])
def test_a_program_with_four_decimals_is_known_and_its_rounding_is_part_of_what_is_reached(linuxcnc, crooked, change):
    path = read_program(PART.replace("M2", "G1 X40 Y0 A0\nG3 I-40 P2 A9 B3 C-3\nM2"), "part.ngc")
    fine, coarse = (compensated_program(path, dialect, Inverse(crooked)) for dialect in (linuxcnc, Coarse()))
    assert re.search(r"X\d+\.\d{4} ", coarse.text)
    # Half a last decimal in each of three angles, 100 mm from the tip: 0.15 µm; the mark adds three decimals at most.
    assert (
        0.01
        < coarse.chord_error_um - fine.chord_error_um
        < 7.0 * 0.5e-4 * np.radians(100.0) * np.sqrt(3.0) * 1e3 + 0.01
    )
    with pytest.raises(StationError, match="compensated already"):
        compensated_program(Coarse().read(change(coarse.text), "again.ngc"), linuxcnc, Inverse(crooked))


def test_a_program_too_short_for_its_mark_says_so(crooked):
    path = read_program(PART, "part.ngc")
    assert "; its poses are too few to carry a mark" in compensated_program(path, Coarse(), Inverse(crooked)).text


def test_nominal_programs_are_not_taken_for_compensated_ones():
    draw = np.random.default_rng(7)
    for count in (1, 2, 5, 6, 7, 20, 300):
        for decimals in (0, 3, 4, 6):
            for _ in range(36):
                poses = np.round(draw.uniform(-50.0, 50.0, (count, 6)), decimals)
                lines = [" ".join(f"{a}{v:.6f}" for a, v in zip("XYZABC", pose, strict=True)) for pose in poses]
                assert not is_marked(read_program("G21 G90\nG0 " + "\n".join(lines) + "\nM2\n", "x.ngc"))


def test_a_pattern_that_is_run_many_times_is_one_pattern():
    draw = np.random.default_rng(3)
    while True:
        pose = np.round(draw.uniform(-50.0, 50.0, 6), 3)
        line = " ".join(f"{a}{v:.3f}" for a, v in zip("XYZABC", pose, strict=True))
        path = read_program(f"G21 G90\nG0 {line}\nG1 X0 F100\n" + f"{line}\nX0\n" * 50 + "M2\n", "x.ngc")
        if _marks(_sums(in_last_decimals(path.poses[:1], DECIMALS)), np.uint64(64 - BITS[4]))[0]:
            break
    assert not is_marked(path)


def test_the_chance_is_what_is_said():
    assert all(0.5 ** (bits * poses) < BY_CHANCE for poses, bits in BITS.items())


def test_the_mark_moves_no_tip_where_the_angles_move(crooked, table2):
    from dbbstation.nc.circle_program import circle_toolpath  # noqa: PLC0415

    done = compensate_toolpath(circle_toolpath(table2.tests["g"].circle, "g"), crooked, keep_arcs=True).toolpath
    with_mark = marked(done)
    assert is_marked(with_mark)
    off = np.abs(with_mark.poses - done.poses)[done.is_move]
    assert off[:, 3:].max() <= 3.01e-7
    assert np.mean(off[:, :3].max(axis=1) > 1e-9) < 0.4  # where one of the angles hardly changes
    assert off[:, :3].max() <= 1.01e-6


def test_what_stands_still_goes_on_standing_still():
    lines = "\n".join(f"X{k % 7 + 0.001 * k:.3f} Y{k % 5} Z{-1000 - k % 3}" for k in range(150))
    path = read_program(f"G21 G90\nG0 X0 Y0 Z-1000 A1 B0 C0\nG1 F500\n{lines}\nG1 A5 F60\nA7\nA9 B2\nM2\n", "x.ngc")
    with_mark = marked(path)
    assert is_marked(with_mark)
    np.testing.assert_array_equal(with_mark.only_turns, path.only_turns)
    np.testing.assert_array_equal(with_mark.turn_deg > 0.0, path.turn_deg > 0.0)
    np.testing.assert_allclose(with_mark.duration_s, path.duration_s, rtol=5e-3, atol=1e-9)
