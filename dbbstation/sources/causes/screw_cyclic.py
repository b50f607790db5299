"""Error source: what repeats with every turn of a strut's screw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.screws import screw_lead_mm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3


class ScrewCyclic(LinearSource):
    """A strut's error goes once up and down with every turn of its screw: dL = a sin(2 pi L / p) + b cos(2 pi L / p).

    p is the lead. The phase is counted from a length of zero between the joints, at which no screw ever stands: only
    the amplitude, the root of a² + b², says something of the screw.
    """

    name = "screw-cyclic"
    belongs_to = Owner.MACHINE
    varies_with = "strut-length"
    form_uncertainty = 0.1  # the error of one turn differs along the screw
    texts = Texts(
        what="The screw wobbles in its bearing, or its encoder sits off the axis: the error repeats with every turn.",
        shows="A fine ripple on the circle, quick where that strut moves fast and slow where it turns round; the same at "
        "the same strut lengths in both directions.",
        confirm="Move the strut slowly over three turns of its screw against a laser interferometer or a linear scale.",
        cure="Centre the encoder, or seat the screw's bearing anew; else enter a table of screw errors as fine as a "
        "quarter of the lead.",
        equation="actual minus driven length = a_i sin(2 pi L_i / p) + b_i cos(2 pi L_i / p), p the screw's lead",
        origin="once-per-turn travel variation of a ball screw, v_2pi of ISO 3408-3; eccentricity of a rotary encoder",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        """Sine and cosine of each strut.

        Raises:
            ModelError: the machine file has no screw lead.
        """
        lead_mm = screw_lead_mm(self.name, machine)
        return tuple(
            Parameter(
                f"strut_{i + 1}_{wave}_um",
                "µm",
                2.0,
                f"{wave} of strut {i + 1} with period {lead_mm:g} mm",
                strut=i + 1,
            )
            for i in range(STRUTS)
            for wave in ("sine", "cosine")
        )

    def shortest_period_mm(self, machine: Machine, values: NDArray[np.float64]) -> float:  # noqa: ARG002
        """The lead.

        Raises:
            ModelError: the machine file has no screw lead.
        """
        return screw_lead_mm(self.name, machine)

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Each strut answers to its own two waves.

        Raises:
            ModelError: the machine file has no screw lead.
        """
        turned_rad = 2.0 * np.pi / screw_lead_mm(self.name, machine) * motion.struts(machine).length_mm
        waves = np.stack([np.sin(turned_rad), np.cos(turned_rad)], axis=-1)
        own = waves[:, :, None, :] * np.eye(STRUTS)[:, :, None]
        return Effect(strut_mm=MM_PER_UM * own.reshape(len(motion), STRUTS, 2 * STRUTS))
