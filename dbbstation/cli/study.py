"""`dbbstation study`: reproducible experiments."""

from __future__ import annotations

from dbbstation.cli.lazy import LazyGroup

STUDIES = {
    "concealed-gravity": "Gravity hidden in a kinematic calibration: found, named, modelled.",
    "coverage": "Do the stated 95 % intervals hold the truth?",
    "gravity": "Gravity identified after the kinematics, as in the paper, and with them.",
    "table-iii": "The paper's three ways to calibrate, on many random machines.",
}
"""Name and one line of help of every study; each is a module of `cli.studies` with a command of its name."""

study = LazyGroup(
    name="study",
    table=STUDIES,
    package="dbbstation.cli.studies",
    help="""Repeat an experiment from a seed to its numbers and its figure.

\b
Examples:
  dbbstation study concealed-gravity --figure concealed.svg
  dbbstation study coverage --machines 500
  dbbstation study table-iii --help
""",
)
