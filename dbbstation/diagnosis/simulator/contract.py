"""The contract of a simulator of one's own: outputs from inputs, parameters and what acts at its ports."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.ports import Ports


class Simulator(ABC):
    """A simulation that is run many times with other parameters. Instances carry no state from one run to the next."""

    @abstractmethod
    def simulate(
        self, inputs: Mapping[str, NDArray[np.float64]], parameters: Mapping[str, float], ports: Ports
    ) -> Mapping[str, NDArray[np.float64]]:
        """Return each output at the times of the recording, shape (n,), in its unit.

        Call `ports.NAME(t, signals)` where something may act, at every step, with the signals that `model.yaml` lists for that port
        as they are then; add what it returns. It is zero until a term is tried there. A step may be asked for more than once, and a
        solver may step back: what has a memory follows the time that it is given.

        Args:
            inputs: `t`, the time of the rows [s], and each input of `model.yaml`, shape (n,).
            parameters: of `model.yaml`, its initial states included, by name.
            ports: of `model.yaml`, by name.
        """
