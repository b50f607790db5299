"""The look at what is left proposes the pitch of a wave, although the wave found is a multiple of it."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.coloured import Coloured, Left
from dbbstation.inference.looks import Sums, looked_for
from dbbstation.inference.patterns import Family


@pytest.mark.parametrize("multiple", [1, 2, 3])
def test_a_wave_of_which_only_a_multiple_is_strong_is_sought_with_its_pitch(rng, multiple):
    """A screw of 10 mm pitch over 100 mm, whose error has one harmonic far above the noise."""
    place = np.sort(rng.uniform(0.0, 100.0, 2000))
    residual = 3.0 * np.sin(2 * np.pi * multiple * place / 10.0) + rng.standard_normal(2000)
    left = Left.of(np.ones((2000, 1)), np.array([np.inf]), residual, Coloured(1.0), None)
    screw = Variable("screw", "mm", Kind.LENGTH, place)
    found = looked_for(left, [screw], np.ones(2000, dtype=bool), 10.0)
    forms = [pattern.form for pattern in found if pattern.family is Family.WAVE]
    pitches = [form.frequency for form in forms if multiple <= form.harmonics and form.harmonics > 1]
    assert min(abs(pitch - 0.1) for pitch in pitches) < 1e-4


@pytest.mark.parametrize("directions", [1, 3])
def test_a_wave_is_moved_to_where_it_explains_most(rng, directions):
    """Beside brute force over the rows: a fit of base, and of cosine and sine in each direction with unit prior."""
    place = np.sort(rng.uniform(40.0, 50.0, 300))
    gain = 1.0 + 0.5 * rng.standard_normal((300, directions))
    base = np.linalg.qr(rng.standard_normal((300, 5)))[0]
    rest = rng.standard_normal(300) + gain @ np.ones(directions) * np.cos(2.0 * np.pi * 1.634 * place)

    def explained(frequency):
        phase = 2.0 * np.pi * frequency * place
        columns = np.hstack([np.cos(phase)[:, None] * gain, np.sin(phase)[:, None] * gain])
        beside = columns - base @ (base.T @ columns)
        along = columns.T @ rest
        return along @ np.linalg.solve(columns.T @ beside + np.eye(2 * directions), along)

    sums = Sums.of(place, np.arange(300), gain, rest, base)
    (most, wave), (other, second) = sums.finer([1.6, 4.0], 10.0)
    assert (most, other) == pytest.approx((explained(wave.frequency), explained(second.frequency)), rel=1e-9)
    tried = 1.6 + np.arange(-225, 226) / (450.0 * 10.0)
    best = tried[np.argmax([explained(each) for each in tried])]
    assert wave.frequency == pytest.approx(best, abs=1.0 / (450.0 * 10.0))
