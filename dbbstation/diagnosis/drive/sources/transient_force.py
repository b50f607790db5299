"""Force in limited stretches of time."""

from __future__ import annotations

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Scale, Texts


class TransientForce(DriveSource):
    """Pulses and steps: F = sum of a_k over t_k to t_k + d_k.

    The source has no form, because the comparison searches for stretches (`dbbstation/inference/stretches.py`).
    """

    name = "transient-force"
    varies_with = "time"
    form_uncertainty = 0.02  # the low-pass rounds edges of pulses
    texts = Texts(
        what="A force that the recorded one does not contain acts for some time: a push, a clamp, a cutting force, a "
        "second drive, or a channel whose zero jumps.",
        shows="What is left jumps at one time and jumps back later, or does not, wherever the drive is and however fast.",
        confirm="Repeat the same motion with nothing else switched on; log what else is running beside the drive.",
        cure="Keep that force away, record it, or enter it as a disturbance at its times.",
        equation="F = sum_k a_k [t_k <= t <= t_k + d_k]",
        origin="change points by the best of all stretches: Jackson et al., IEEE Signal Process. Lett. 12 (2005) 105; "
        "look-elsewhere odds: Gross and Vitells, Eur. Phys. J. C 70 (2010) 525",
    )

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:  # noqa: ARG002
        return ()
