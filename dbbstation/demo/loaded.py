"""Loads what the commands of a demonstration share: imported once, by the process that they are copies of."""

import numba  # noqa: F401

import dbbstation.station.assembly
import dbbstation.tasks.diagnosed
import dbbstation.tasks.reporting
import dbbstation.virtual.control  # noqa: F401
from dbbstation.sources.registry import known_sources

known_sources()
