"""Growth that follows a shop and no law over time, in sessions of the independent plant, with thermometers and without."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from dbbstation.inference.levels import Verdict
from studies.diagnosed import diagnose_sessions
from tests.plant.mechanisms.bar import BarDrift
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.thermal import SpindleGrowth, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Shop
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("few_parts")

NAMES = ("gravity", "backlash", "thermal-struts", "thermal-frame", "spindle-growth", "bar-drift", "jig-thermal")
FEW = ("thermal-struts", "thermal-frame", "bar-drift")
SHOP = Shop(rise_k=1.2, time_constant_s=900.0)
SHARES = (1.0, 0.6, 1.3, 0.8, 1.1, 0.9)
RESOLUTION_K = 0.1

PARTS = {
    "thermal-struts": (ThermalStruts(SHOP, shares=SHARES, logged=True), "growth_um_m_k", 11.5),
    "thermal-frame": (ThermalFrame(SHOP, logged=True), "growth_um_m_k", 11.5),
    "spindle-growth": (SpindleGrowth(SHOP, growth_um_k=4.0, logged=True), "growth_um_k", 4.0),
    "bar-drift": (BarDrift(SHOP, logged=True), "drift_um_k", -1.6),
}


@dataclass(frozen=True)
class Coarse(Mechanism):
    """Another mechanism whose thermometers show tenths of a kelvin."""

    name: ClassVar[str] = "coarse"

    of: Mechanism = PARTS["thermal-frame"][0]

    def columns(self, motion, platform):
        shown = self.of.columns(motion, platform)
        return {name: RESOLUTION_K * np.round(values / RESOLUTION_K) for name, values in shown.items()}


def diagnosed(folder, mechanism, *more, whole=True):
    """Of all fifteen tests, or of eight with fewer readings and the causes that warm up: the sizes are many standard deviations."""
    plan = table_ii_plan(83) if whole else subset(table_ii_plan(83), EIGHT)
    record(
        folder, seed=83, plan=plan, mechanisms=[RandomKinematics(), mechanism, *more], rate_hz=10.0 if whole else 2.5
    )
    found = diagnose_sessions([folder], NAMES if whole else FEW, (), lambda _: None).diagnosis
    return found, {f.name: f for f in found.sources if f.verdict in {Verdict.IDENTIFIED, Verdict.AMBIGUOUS}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "whole"),
    [("bar-drift", False), *(pytest.param(name, True, marks=pytest.mark.nightly) for name in PARTS)],
)
def test_what_follows_a_thermometer_is_named_with_its_growth_per_kelvin(tmp_path, name, whole):
    mechanism, parameter, per_kelvin = PARTS[name]
    found, named = diagnosed(tmp_path / "s", mechanism, whole=whole)
    assert set(named) == {name}
    value = named[name].parameters[parameter]
    assert value.value == pytest.approx(per_kelvin, abs=4.0 * value.uncertainty)
    # Tests know it to a few per cent; a thermometer stands for its body to a tenth only.
    assert value.uncertainty < 0.15 * abs(per_kelvin)
    assert found.unexplained.variable is None
    assert {location.variable for location in found.locations} == {"temperature"}


@pytest.mark.nightly  # a bar that follows a finer thermometer is in CI
def test_tenths_of_a_kelvin_do(tmp_path):
    mechanism, parameter, per_kelvin = PARTS["thermal-frame"]
    _, named = diagnosed(tmp_path / "s", ThermalFrame(SHOP), Coarse(of=mechanism))
    # Ten micrometres by a thermometer that is off by a hundredth of that: what makes up for it is no other cause.
    assert [name for name, f in named.items() if f.verdict is Verdict.IDENTIFIED] == ["thermal-frame"]
    assert named["thermal-frame"].parameters[parameter].value == pytest.approx(per_kelvin, rel=0.1)


@dataclass(frozen=True)
class Bracket(Mechanism):
    """The bracket of one strut grows with the shop, 6 µm for each kelvin."""

    name: ClassVar[str] = "bracket"

    def lengthening_mm(self, motion, platform):
        del platform
        return 0.006 * SHOP.excess_k(motion)[:, None] * np.eye(6)[2]

    def columns(self, motion, platform):
        del platform
        return {"machine_temp_c": motion.scene.ambient_temp_c + SHOP.excess_k(motion)}


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_what_has_no_name_is_told_over_the_thermometer_that_it_follows(tmp_path, whole):
    found, named = diagnosed(tmp_path / "s", Bracket(), whole=whole)
    assert not named
    assert (found.unexplained.variable, found.unexplained.strut) == ("machine-temperature", 3)
    curve = found.unexplained.curve
    assert curve.unit == "degC"
    slope = np.polyfit([p.at for p in curve.points], [p.value_um for p in curve.points], 1)[0]
    assert slope == pytest.approx(6.0, rel=0.15)
