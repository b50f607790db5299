"""Whether a report is a certificate, and what is missing."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING

from dbbstation.files.formats.session import starts_of
from dbbstation.files.recordings.event_log import CLOCK_S, impossible_day, sealed_at
from dbbstation.results.report import CertificateState
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder

MOST_NAMED = 3
"""Greatest number of missing facts in the title; the first page names all."""


def certified(sessions: Sequence[SessionFolder], job: str, place: str, *, tolerances: bool) -> CertificateState:
    """Return whether a report is a certificate, and the missing facts."""
    lacking = dict.fromkeys(text for session in sessions for text in _lacking(session, job))
    if not place.strip():
        lacking["place unknown"] = None
    if not tolerances:
        lacking["no tolerance"] = None
    named = f"Not a certificate: {listed(tuple(lacking), MOST_NAMED)}"
    return CertificateState(named if lacking else "Certificate of circular tests", tuple(lacking), place or None)


def _lacking(session: SessionFolder, job: str) -> list[str]:
    bar = session.bar
    accepted = session.accepted
    of_bar: Sequence[tuple[bool, str]] = [(True, "bar unknown")]
    if bar is not None:
        grows = bar.expansion_um_m_k != 0.0 and (bar.temp_c is None or bar.expansion_um_m_k is None)
        of_bar = (
            (not bar.serial_number, "serial number of the bar unknown"),
            (not bar.calibrator_certified, "calibrator's certificate unknown"),
            (bar.calibrated is None, "calibration date of the bar unknown"),
            (grows, "temperature or expansion of the bar unknown"),
        )
    checks = (
        (session.virtual, "virtual machine"),
        (not session.serial_number, "serial number of the machine unknown"),
        (session.ambient_temp_c is None, "temperature unknown"),
        *of_bar,
        (bool(session.bar_waiver), "bar not freshly calibrated"),
        (not session.operator.strip(), "operator unknown"),
        (not (job or session.job).strip(), "job unknown"),
        (any(run.started is None for run in accepted), "dates unknown"),
        (session.seal is None, "not sealed"),
    )
    return [text for lacks, text in checks if lacks] + list(_dates(session)) + _early(session)


def _early(session: SessionFolder) -> list[str]:
    early = [run for run, after in sealed_after(session) if after < -timedelta(seconds=CLOCK_S)]
    return [f"run {early[0].label} sealed before it was measured"] if early else []


def sealed_after(session: SessionFolder) -> list[tuple[RunEntry, timedelta]]:
    """Return accepted runs with the time from start to seal; a virtual machine has a separate clock."""
    at = {} if session.virtual or session.seal is None else sealed_at(session.folder)
    runs = session.accepted if at else ()
    dated = [(run, run.started, at.get(run.key)) for run in runs]
    return [(run, sealed - began) for run, began, sealed in dated if began is not None and sealed is not None]


def _dates(session: SessionFolder) -> Iterator[str]:
    moments = starts_of(session.accepted)
    if not moments:
        return
    first, last, bar = min(moments), max(moments), session.bar
    yield from (f"a run of {wrong}" for wrong in dict.fromkeys(map(impossible_day, (first, last))) if wrong)
    if bar is None:
        return
    if bar.calibrated is not None and not timedelta(0) <= first - bar.calibrated <= LONGEST_BAR:
        yield f"bar calibrated on {bar.calibrated:%Y-%m-%d}, runs of {first:%Y-%m-%d}"
    if fault := bar.certificate_fault(first.date()):
        yield f"{fault.removeprefix('the ').split(';')[0]}, runs of {first:%Y-%m-%d}"


LONGEST_BAR = timedelta(days=366)
"""Longest time from a bar's calibration to a certified run: wear and knocks of a year change the bar."""
