"""The look at what is left proposes the pitch of a wave, although the wave found is a multiple of it."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.coloured import Coloured, Left
from dbbstation.inference.looks import looked_for
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
