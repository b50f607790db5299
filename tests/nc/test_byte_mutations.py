"""Programs with bytes changed, as a bad line or a bad disk leaves them: read, or refused by name; at once either way.

What LinuxCNC refuses of them must be refused here too. `DBBSTATION_FUZZ=5000` changes as many as that, `-m nightly` three times as many.
"""

from __future__ import annotations

import os
import random
import time
import tracemalloc

import numpy as np
import pytest

from dbbstation.errors import InputError, Problem, StationError
from dbbstation.files.source_text import decode
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.mark import check_nominal
from dbbstation.nc.toolpath import RowKind
from tests.nc.interpreter import events, needs_rs274

WHOLE = b"""%
(part) ; one
N10 G21 G90 G94 G17 G40 G49 G64 P0.01
N20 G0 X-10.5 Y0 Z-1000 A0 B0 C0
G1 X10 F1000 S800 M3
A2.5 B-1 F120
G3 X0 Y10 I-10 J0 Z-990 F600
G2 X10 Y0 R-10
G91 G1 X1 Y-.5
G4 P.25
G20
G1 X-.1 F10
G90 G53 G1 Z-39
M0
M30
%
"""
MUTANTS = int(os.environ.get("DBBSTATION_FUZZ", "500"))
counted = pytest.mark.parametrize("count", [MUTANTS, pytest.param(3 * MUTANTS, marks=pytest.mark.nightly)])
AMONG = bytes(range(256)) + b"0123456789.-+GMXYZABCFIJPRN %;()\n\r\t" * 8


def mutants(seed: int, count: int) -> list[bytes]:
    draw = random.Random(seed)  # noqa: S311 - the same mutants each time, nothing secret
    return [mutant(draw) for _ in range(count)]


def mutant(draw: random.Random) -> bytes:
    data = bytearray(WHOLE)
    for _ in range(draw.choice([1, 1, 1, 2, 3, 8])):
        place, kind = draw.randrange(len(data)), draw.random()
        if kind < 0.4:
            data[place] = draw.choice(AMONG)
        elif kind < 0.6:
            data.insert(place, draw.choice(AMONG))
        elif kind < 0.8:
            del data[place]
        elif kind < 0.9:
            other = draw.randrange(len(data))
            data[place:place] = data[other : other + draw.randint(1, 20)] * draw.choice([1, 1, 2, 300])
        else:
            del data[place : place + draw.randint(1, 60)]
    return bytes(data)


def read(linuxcnc, data: bytes):
    """The toolpath; None where the file or the program is refused."""
    faults: list[Problem] = []
    text = decode(data, "mutant.ngc", faults)
    if text is None:
        assert faults
        return None
    try:
        return linuxcnc.read(text, "mutant.ngc")
    except InputError:
        return None


@pytest.mark.slow
@counted
def test_every_mutant_is_read_or_refused_at_once_and_in_little_memory(linuxcnc, count):
    accepted, slowest = 0, 0.0
    tracemalloc.start()
    try:
        for data in mutants(1, count):
            began = time.process_time()
            path = read(linuxcnc, data)
            slowest = max(slowest, time.process_time() - began)
            if path is not None:
                accepted += 1
                assert np.isfinite(path.poses[path.is_move]).all()
                assert np.isfinite(path.feed[path.kind == RowKind.FEED]).all()
                check_nominal(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.05 * count < accepted < 0.9 * count
    assert slowest < 10.0
    assert peak < 500e6


@counted
def test_accepted_mutants_are_compensated_or_refused_by_name(linuxcnc, crooked, count):
    written = 0
    drawn = mutants(2, count // 4)
    for data in drawn:
        path = read(linuxcnc, data)
        if path is None:
            continue
        try:
            text = compensated_program(path, linuxcnc, Inverse(crooked)).text
        except StationError:
            continue
        written += 1
        assert linuxcnc.read(text, "again.ngc").is_move.any()
    assert written > 0.05 * len(drawn)


@pytest.mark.slow
@needs_rs274
@counted
def test_mutants_that_linuxcnc_refuses_are_refused(linuxcnc, tmp_path, count):
    for data in mutants(3, count // 2):
        if read(linuxcnc, data) is not None:
            assert events(data, tmp_path) is not None, data.decode()
