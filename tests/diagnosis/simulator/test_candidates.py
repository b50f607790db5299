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
