"""A load equal in both directions."""

from __future__ import annotations

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts


class ConstantLoad(DriveSource):
    """A constant force: part of a weight, or a zero offset of the channel."""

    name = "constant-load"
    varies_with = "speed"
    form_uncertainty = 0.0  # a constant is exact
    texts = Texts(
        what="A constant force adds to the drive's: the share of the platform's weight along a strut, a spring that is "
        "long against the travel, or a wrong zero of the force or current channel.",
        shows="Both directions of travel need a force that is shifted by the same amount, at every speed.",
        confirm="Release the drive from its load, or tilt it, and record again; with the motor off the channel must "
        "read zero.",
        cure="Balance the weight, or enter it as a gravity feed-forward; zero the channel.",
        equation="F = F_0",
        origin="statics; offset of the drive in Janot, Vandanjon and Gautier, IEEE TCST 22 (2014)",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = Parameter("load_n", "N", 0.3 * scale.force_n, "force that the drive must add at every position")
        return (DriveForm((size,), lambda s, _: np.ones((len(s.t_s), 1))),)
