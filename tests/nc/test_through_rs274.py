"""Generated programs before and after compensation, both through LinuxCNC's interpreter.

`DBBSTATION_FUZZ=5000` runs as many programs as that; `DBBSTATION_FUZZ_FROM` is the first seed.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from tests.nc.grammar import part
from tests.nc.interpreter import RS274, events
from tests.nc.through_rs274 import DiffersError, compare, compare_elsewhere

pytestmark = pytest.mark.skipif(RS274 is None, reason="LinuxCNC's interpreter rs274 is not installed")

COUNT = int(os.environ.get("DBBSTATION_FUZZ", "500"))
FIRST = int(os.environ.get("DBBSTATION_FUZZ_FROM", "0"))
SHARES = 10

OFFSETS = {5220: 2, 5221: 10.0, 5222: -3.0, 5223: 1.0, 5224: 2.0, 5241: -7.0, 5242: 4.0, 5243: 2.0, 5246: 3.0}
"""G55 in force, G54 and G55 both off zero: 254 mm in X and more [in, deg]."""


@pytest.fixture(scope="module")
def bent(reference):
    """Joint errors of 20 µm and strut errors of 10 µm."""
    drawn = np.random.default_rng(27)
    sources = known_sources()
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.01, 6))
    joints = Fitted(sources["base-joints"], drawn.normal(0.0, 0.02, 18))
    return MachineModel(reference, (struts, joints))


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_a_compensated_program_does_what_the_nominal_one_does(share, linuxcnc, bent, tmp_path):
    for seed in range(FIRST + share, FIRST + COUNT, SHARES):
        text = part(seed)
        wanted = events(text, tmp_path)
        assert wanted is not None, f"seed {seed}: LinuxCNC refuses\n{text}"
        written = compensated_program(linuxcnc.read(text, "part.ngc"), linuxcnc, Inverse(bent)).text
        done = events(written, tmp_path)
        assert done is not None, f"seed {seed}: LinuxCNC refuses what was written\n{text}\n{written}"
        try:
            groups = compare(wanted, done, bent)
            if "G5" in text.upper() or seed % 8 == 0:
                away = events(written, tmp_path, OFFSETS)
                if "o100" in written:
                    assert not any(event.kind in {"RAPID", "FEED", "ARC"} for event in away)
                    assert [event.kind for event in away if event.kind != "SAID"] == ["PAUSE"]
                else:
                    compare_elsewhere(groups, events(text, tmp_path, OFFSETS), away)
        except DiffersError as error:
            raise AssertionError(f"seed {seed}: {error}\n{text}\n{written}") from None
