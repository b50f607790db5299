"""Long programs are compensated part by part: the same comes out as at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc import splitting
from dbbstation.nc.splitting import parts_of, runs_of
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from tests.nc.whole import compensate_toolpath

GAPS_UM = np.array([3.0, 5.0, 2.0, 4.0, 6.0, 1.0])

SPIKES = np.append(GAPS_UM / 2.0, 2.0)
"""Heights [µm] and the way over which they fade [mm]."""

LAG_S = 1e-3 * np.array([1.0, 2.0, 3.0, 1.5, 2.5, 1.2])

LINES = """\
G21 G90 G94
G64 P0.01
G0 X-60 Y-40 Z-1000 A5 B-4 C0
G4 P0.2
G1 X60 F600
M1
G1 Y40
G4 P0.1
G1 X40 Y60 A4
G0 Z-990
G0 X0
G1 X-60 A-5 B4
(MSG, half)
G1 Y-40 Z-1010
G1 X-20
M2
"""


def remembering(reference, name: str, values: np.ndarray) -> MachineModel:
    drawn = np.random.default_rng(24)
    sources = known_sources()
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.1, 6))
    machine = replace(reference, acceleration_mm_s2=50_000.0)
    return MachineModel(machine, (struts, Fitted(sources[name], values)))


@pytest.mark.parametrize(("name", "values"), [("backlash", GAPS_UM), ("servo-lag", LAG_S), ("reversal-spike", SPIKES)])
def test_what_a_machine_remembers_goes_from_part_to_part(linuxcnc, reference, monkeypatch, name, values):
    model = remembering(reference, name, values)
    path = linuxcnc.read(LINES, "lines.ngc")
    whole = compensate_toolpath(path, model, started_s=10.0)
    monkeypatch.setattr(splitting, "ROWS_AT_ONCE", 3)
    assert len(parts_in(path)) > 2
    parts = compensate_toolpath(path, model, started_s=10.0)
    np.testing.assert_array_equal(parts.toolpath.kind, whole.toolpath.kind)
    assert parts.toolpath.text == whole.toolpath.text
    np.testing.assert_allclose(parts.toolpath.poses, whole.toolpath.poses, rtol=0.0, atol=2e-6)
    np.testing.assert_allclose(parts.toolpath.feed, whole.toolpath.feed, rtol=1e-5)
    assert parts.chord_um == pytest.approx(whole.chord_um, abs=1e-3)
    assert parts.greatest_um == pytest.approx(whole.greatest_um, abs=1e-3)


def test_an_arc_is_cut_within_its_chord_error(linuxcnc, crooked, monkeypatch):
    path = linuxcnc.read("G21 G90\nG0 X50 Y0 Z-1000 A0 B0 C0\nG3 X50 Y0 I-50 P3 F500\nM2\n", "arc.ngc")
    whole = compensate_toolpath(path, crooked)
    monkeypatch.setattr(splitting, "ROWS_AT_ONCE", 500)
    parts = compensate_toolpath(path, crooked)
    assert len(path) > 5000
    assert parts.chord_um <= 0.1
    np.testing.assert_allclose(parts.toolpath.poses[-1], whole.toolpath.poses[-1], rtol=0.0, atol=2e-6)
    # A part may take one piece more than its share of the whole, and none is much shorter.
    assert 0 <= len(parts.toolpath) - len(whole.toolpath) <= len(parts_in(path))
    shortest_mm = [each.toolpath.tip_mm[each.toolpath.kind == RowKind.FEED].min() for each in (parts, whole)]
    assert shortest_mm[0] > 0.9 * shortest_mm[1]


def test_parts_begin_with_moves_at_feed(linuxcnc, monkeypatch):
    monkeypatch.setattr(splitting, "ROWS_AT_ONCE", 2)
    path = linuxcnc.read(LINES, "lines.ngc")
    parts = parts_in(path)
    assert sum(map(len, parts)) == len(path)
    np.testing.assert_array_equal(np.concatenate([part.line for part in parts]), path.line)
    assert all(part.kind[0] == RowKind.FEED and part.tip_mm[0] > 0.0 for part in parts[1:])


def parts_in(path):
    return [part for part, _ in parts_of(path, lambda part: runs_of(part, np.zeros(len(part))))]
