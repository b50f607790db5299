"""What may be missing at a port, and within what its numbers are sought."""

import numpy as np

from dbbstation.diagnosis.simulator.candidates import candidates
from dbbstation.diagnosis.simulator.model import SimulatorPort
from dbbstation.diagnosis.simulator.terms import TermForm


def test_a_hinge_is_sought_where_its_signal_was():
    port = SimulatorPort("force", "N", {"x": "m"})
    signals = {"force": {"t": np.arange(5.0), "x": np.array([0.3, -1.5, 0.2, 2.5, 0.0])}}
    (hinge,) = (one for one in candidates((port,), signals) if one.term.form is TermForm.HINGE)
    assert hinge.term.bounds == ((-1.5, 2.5),)


def test_places_on_a_signal_whose_values_repeat_are_each_once():
    port = SimulatorPort("body", "W", {"heat": "W"})
    heat = np.array([0.0] * 40 + [5.0] * 3 + [10.0] * 57)
    signals = {"body": {"t": np.arange(100.0), "heat": heat}}
    found = candidates((port,), signals)
    assert all((np.diff(grid) > 0.0).all() for one in found for grid in one.grids)
    assert not any(one.term.form is TermForm.HINGE for one in found)
    heat[40:60] = 5.0
    (hinge,) = (one for one in candidates((port,), signals) if one.term.form is TermForm.HINGE)
    assert hinge.grids == ((5.0,),)
