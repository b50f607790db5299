"""Make the recording of a drive in `fixtures/drives` anew: `python -m tests.diagnosis.drive.make_example`."""

from __future__ import annotations

from pathlib import Path

from tests.diagnosis.drive.plant import Truth, record, to_and_fro

TRUTH = Truth(mass_kg=80.0, viscous=200.0, coulomb=20.0, viscous_asymmetry=-40.0)
SECONDS = 16.0
TOGETHER = 4
"""Samples of the simulation, at 1 kHz, of which the file has the mean, as a logger averages."""


def example() -> str:
    columns = record(TRUTH, to_and_fro(seconds=SECONDS), seed=20261121)
    means = [column.reshape(-1, TOGETHER).mean(axis=1) for column in columns]
    rows = [f"{t - means[0][0]:.3f},{x:.5f},{f:.2f}" for t, x, f in zip(*means, strict=True)]
    head = [
        "# A simulated strut drive: 80 kg, Coulomb friction 20 N, viscous friction 160 N s/m forwards, 240 backwards.",
        "# force_n is positive towards greater positions.",
        "t_s,position_mm,force_n",
    ]
    return "\n".join([*head, *rows]) + "\n"


if __name__ == "__main__":
    path = Path(__file__).parents[3] / "fixtures" / "drives" / "strut.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_text(example(), encoding="utf-8")
