"""Limits of noise where the other runs' noise differs beyond all measure."""

from __future__ import annotations

from types import SimpleNamespace

from dbbstation.quality.finding import FindingVerdict
from dbbstation.quality.knowledge import Others
from dbbstation.quality.single import noise


def test_noise_that_differs_beyond_measure_decides_nothing():
    """A run that was computed has none, another has some, and a third a micrometre: the limit overflowed."""
    one = SimpleNamespace(noise=SimpleNamespace(reading_um=0.3, reading_freedom=1.0, known=True))
    others = Others(noise_um=(1e-9, 0.5, 900.0, 1e-9, 400.0), **dict.fromkeys(("closure_um", "drift_um", "directions_um", "repeats_um", "across_um"), ()), opposite=None, earlier=None)  # fmt: skip
    found = noise(one, others)
    assert found.verdict is FindingVerdict.CANNOT_TELL
    assert "differs too much" in found.text
