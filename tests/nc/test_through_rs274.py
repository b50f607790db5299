"""Generated programs before and after compensation, both through LinuxCNC's interpreter.

Fifty hold every word of the grammar. `DBBSTATION_FUZZ=5000` runs as many programs as that; `DBBSTATION_FUZZ_FROM` is the first seed. `-m nightly` runs 50,000, in
blocks; `DBBSTATION_FUZZ_PASSED` names a file in which those that passed are noted, and a run that was interrupted goes on there.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from tests.nc.grammar import part
from tests.nc.interpreter import events, needs_rs274
from tests.nc.through_rs274 import MOVES, DiffersError, compare

pytestmark = needs_rs274

COUNT = int(os.environ.get("DBBSTATION_FUZZ", "50"))
FIRST = int(os.environ.get("DBBSTATION_FUZZ_FROM", "0"))
SHARES = 2

NIGHTLY_SEEDS, BLOCK = range(100, 51_000), 100
PASSED = os.environ.get("DBBSTATION_FUZZ_PASSED")

OFFSETS = {5220: 2, 5221: 10.0, 5222: -3.0, 5223: 1.0, 5224: 2.0, 5241: -7.0, 5242: 4.0, 5243: 2.0, 5246: 3.0}
"""G55 in force, G54 and G55 both off zero: 254 mm in X and more [in, deg]."""

PLACES = {
    "G54": (4.0, -3.0, 5.0, 0.5, -0.4, 0.3),
    "G55": (-6.0, 2.5, -7.0, 0.0, 0.2, -0.1),
    "G92": (1.5, 0.0, -2.0, 0.0, 0.1, 0.0),
    "G28": (10.0, -5.0, -955.0, 0.5, 0.0, 0.0),
    "G30": (0.0, 0.0, -950.0, 0.0, 0.0, 0.0),
}
LENGTHS = {1: 7.5, 2: -4.0}
"""What some programs are compensated for [mm, deg]."""

FIRST_OF = {"G28": 5161, "G30": 5181, "G92": 5211, "G54": 5221, "G55": 5241}


def declared(seed: int) -> tuple[ControlSetup, dict[int, float], str]:
    """The setup of a program, and the same as LinuxCNC's parameters and tool table, in inches."""
    places = PLACES if seed % 3 == 0 else {name: PLACES[name] for name in ("G28", "G30")}
    lengths = {tool: (0.0, 0.0, length, 0.0, 0.0, 0.0) for tool, length in LENGTHS.items()}
    stored = {5210: float(seed % 3 == 0)}
    for name, values in places.items():
        stored |= {FIRST_OF[name] + axis: value / (25.4 if axis < 3 else 1.0) for axis, value in enumerate(values)}
    table = "".join(f"T{tool} P{tool} Z{length / 25.4:.9f}\n" for tool, length in LENGTHS.items())
    return ControlSetup(places, lengths), stored, table


@pytest.fixture(scope="module")
def bent(reference):
    """Joint errors of 20 µm and strut errors of 10 µm."""
    drawn = np.random.default_rng(27)
    sources = known_sources()
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.01, 6))
    joints = Fitted(sources["base-joints"], drawn.normal(0.0, 0.02, 18))
    return MachineModel(reference, (struts, joints))


def in_inches(text: str) -> str:
    """What a program expects of its offsets, for `rs274` without a machine, which stores them in inches."""

    def inches(match: re.Match[str]) -> str:
        number = int(match[1])
        axis = (number - 5401) % 20 if number < 5420 else (number - 5201) % 20
        axis = number - 5211 if 5211 <= number < 5220 else axis
        return f"#{match[2]}-[{float(match[3]) / (25.4 if axis < 3 else 1.0):.9f}]"

    return _EXPECTED.sub(inches, text)


_EXPECTED = re.compile(r"#(?=\[?(\d{4}))(\[?\d{4}(?:\+20\*#5220\])?)-\[([-\d.]+)\]")


@pytest.fixture
def does_the_same(linuxcnc, bent, tmp_path):
    def check(seed: int) -> None:
        text = part(seed)
        setup, stored, table = declared(seed)
        wanted = events(text, tmp_path, stored, table)
        if wanted is None:  # an arc by its radius whose begin another work system moved away
            with pytest.raises(InputError, match="no arc of R"):
                linuxcnc.read(text, "part.ngc", setup=setup)
            return
        path = linuxcnc.read(text, "part.ngc", setup=setup)
        written = in_inches(compensated_program(path, linuxcnc, Inverse(bent)).text)
        done = events(written, tmp_path, stored, table)
        assert done is not None, f"seed {seed}: LinuxCNC refuses what was written\n{text}\n{written}"
        try:
            compare(wanted, done, bent)
            if seed % 8 == 0:
                away = events(written, tmp_path, OFFSETS, table)
                assert [event.kind for event in away if event.kind != "SAID"] == ["PAUSE"]
        except DiffersError as error:
            raise AssertionError(f"seed {seed}: {error}\n{text}\n{written}") from None

    return check


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_a_compensated_program_does_what_the_nominal_one_does(share, does_the_same):
    for seed in range(FIRST + share, FIRST + COUNT, SHARES):
        does_the_same(seed)


@pytest.mark.nightly
@pytest.mark.parametrize("first", NIGHTLY_SEEDS[::BLOCK])
def test_so_do_fifty_thousand(first, does_the_same):
    noted = Path(PASSED) if PASSED else None
    if noted is not None and noted.exists() and str(first) in noted.read_text().split():
        pytest.skip(f"seeds from {first} passed before")
    for seed in range(first, first + BLOCK):
        does_the_same(seed)
    if noted is not None:
        with noted.open("a") as file:
            file.write(f"{first}\n")


# The comparison itself: what was wrong once, done to a program that is right.

PART = """\
G21 G90 G54
G0 X0 Y0 Z-1000 A0 B0 C0
S0.5 M3
G61
G1 X50 F500
G4 P0.5
G1 Y20 F300
(MSG, turn it)
M1
G3 I5 F200
G55 G0 X5 Y5 Z-1000 A0 B0 C0
G1 X6
M8
G1 X20
M30
"""

FAULTS = {
    "a feed": lambda text: text.replace("F300", "F303", 1),
    "a dwell": lambda text: text.replace("G4 P0.5\n", ""),
    "a longer dwell": lambda text: text.replace("G4 P0.5", "G4 P0.51"),
    "M1": lambda text: text.replace("M1\n", "M0\n"),
    "M30": lambda text: text.replace("M30", "M2"),
    "a message": lambda text: text.replace("(MSG, turn it)", "; MSG, turn it"),
    "the spindle": lambda text: text.replace("S0.5 M3", "S0.6 M3"),
    "coolant": lambda text: text.replace("M8\n", ""),
    "the place of coolant": lambda text: re.sub(r"M8\n(.*\n)", r"\1M8\n", text),
    "a work system": lambda text: text.replace("G55\n", ""),
    "exact stops on the way": lambda text: text.replace("G64 P0.0001 Q0\n", ""),
    "no exact stop": lambda text: text.replace("G61\n", ""),
    "a micrometre": lambda text: re.sub(
        r"(?m)^(G1 X\S+ Y)(\S+)", lambda m: f"{m[1]}{float(m[2]) + 1e-3:.6f}", text, count=1
    ),
    "pieces of an arc": lambda text: re.sub(r"(?m)(F200\n)(?:G1.*\n){5}", r"\1", text),
    "a rapid": lambda text: re.sub(r"(?m)(^G55\n)G0.*\n", r"\1", text),
}


@pytest.fixture(scope="module")
def wavy(bent):
    drawn = np.random.default_rng(28)
    return MachineModel(bent.machine, (Fitted(known_sources()["base-joints"], drawn.normal(0.0, 0.2, 18)),))


def test_a_right_program_passes(linuxcnc, wavy, tmp_path):
    setup, stored, table = declared(0)
    written = compensated_program(linuxcnc.read(PART, "part.ngc", setup=setup), linuxcnc, Inverse(wavy)).text
    wanted = events(PART, tmp_path, stored, table)
    groups = compare(wanted, events(in_inches(written), tmp_path, stored, table), wavy)
    assert sum(event.kind in MOVES for event in wanted) == len(groups)


@pytest.mark.parametrize("fault", FAULTS)
def test_the_comparison_finds(fault, linuxcnc, wavy, tmp_path):
    written = compensated_program(linuxcnc.read(PART, "part.ngc"), linuxcnc, Inverse(wavy)).text
    wrong = FAULTS[fault](written)
    assert wrong != written
    with pytest.raises(DiffersError):
        compare(events(PART, tmp_path), events(wrong, tmp_path), wavy)


@pytest.mark.parametrize("word", ["G54", "G55"])
def test_with_offsets_the_comparison_finds_a_work_system_that_is_missing(word, linuxcnc, wavy, tmp_path):
    setup, stored, table = declared(0)
    written = compensated_program(linuxcnc.read(PART, "part.ngc", setup=setup), linuxcnc, Inverse(wavy)).text
    wrong = in_inches(written.replace(f"{word}\n", "G56\n"))
    with pytest.raises(DiffersError):
        compare(events(PART, tmp_path, stored, table), events(wrong, tmp_path, stored, table), wavy)
