"""Classes for you to subclass: simulators, error sources, physics of a table or of a port, dialects of NC programs."""

from __future__ import annotations

from dbbstation.diagnosis.simulator.contract import Simulator
from dbbstation.laws.contract import PortSource, TableSource
from dbbstation.machine.geometry import STRUTS
from dbbstation.nc.dialect import Dialect
from dbbstation.nc.words import WordDialect
from dbbstation.sources.contract import (
    SMOOTH_MM,
    Effect,
    ErrorSource,
    LinearSource,
    Motion,
    Need,
    Owner,
    Parameter,
    SourceWithHistory,
    Texts,
    of_each_strut,
)

__all__ = [
    "SMOOTH_MM",
    "STRUTS",
    "Dialect",
    "Effect",
    "ErrorSource",
    "LinearSource",
    "Motion",
    "Need",
    "Owner",
    "Parameter",
    "PortSource",
    "Simulator",
    "SourceWithHistory",
    "TableSource",
    "Texts",
    "WordDialect",
    "of_each_strut",
]
