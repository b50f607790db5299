"""Conditions of a session as table rows."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from dbbstation.facts.digits import to_its_place
from dbbstation.files.formats.session import starts_of
from dbbstation.files.recordings.event_log import anchor_of
from dbbstation.report.certificate import sealed_after

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.files.formats.session import Note, RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.plan.bar import Bar
    from dbbstation.results.circles import MeasuredCircle

_NOT_NOTED = "not noted"


def conditions(session: SessionFolder, circles: Sequence[MeasuredCircle], job: str) -> tuple[tuple[str, str], ...]:
    """Return each condition's name and value; a missing value is "not noted"."""
    compensated = sum(1 for run in session.accepted if run.program is not None)
    accepted = len(session.accepted)
    return (
        ("machine", session.machine.name),
        ("serial number", session.serial_number or _NOT_NOTED),
        ("operator", session.operator or _NOT_NOTED),
        ("job", job or session.job or _NOT_NOTED),
        ("measured", when_measured(one.entry for one in circles)),
        ("plan", session.plan.name),
        ("runs", _runs(session)),
        ("programs", f"{compensated} of {accepted} accepted runs under NC programs that the session keeps"),
        ("instrument", _instrument(session)),
        *_bar(session.bar, session.bar_waiver),
        ("temperature of the shop", _shop(session)),
        ("logged temperatures", _logged(circles)),
        *(("noted", _noted(note)) for note in session.notes),
        ("seal", _seal(session)),
        *(("changed since", amendment.text) for amendment in session.amendments),
    )


def identity(session: SessionFolder) -> tuple[tuple[str, str], ...]:
    """Return a session's identity in short: machine, operator, bar, temperature, seal."""
    bar, when = session.bar, ""
    if bar is not None and bar.calibrated is not None:
        when = f", calibrated {bar.calibrated:%Y-%m-%d}{'' if bar.temp_c is None else f' at {_degc(bar.temp_c)}'}"
    return (
        ("machine no.", session.serial_number or _NOT_NOTED),
        ("operator", session.operator or _NOT_NOTED),
        ("bar", _NOT_NOTED if bar is None else f"{bar.serial_number or 'without number'}{when}"),
        ("shop", _shop(session)),
        (
            "seal",
            "none"
            if session.seal is None
            else f"anchor {(anchor_of(session.seal) or 'none')[:ANCHOR_SHOWN]}, {len(session.amendments)} amendments{_late(session)}",
        ),
    )


def _late(session: SessionFolder) -> str:
    days = max((after.days for _, after in sealed_after(session)), default=0)
    return f", {days} {'day' if days == 1 else 'days'} after the measurement" if days > 0 else ""


ANCHOR_SHOWN = 16
"""Number of digits of an anchor on the first page; the conditions contain all."""


def when_measured(runs: Iterable[RunEntry]) -> str:
    """Return first and last start, in words."""
    moments = starts_of(runs)
    if not moments:
        return _NOT_NOTED
    first, last = min(moments), max(moments)
    return f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M %Z}" if last > first else f"{first:%Y-%m-%d %H:%M %Z}"


def _instrument(session: SessionFolder) -> str:
    read = [run.instrument for run in session.accepted]
    told = dict.fromkeys(
        "virtual: " * one.virtual + one.text for one in read or [session.instrument] if one is not None
    )
    if not told and session.instrument is not None:
        return "virtual: " * session.instrument.virtual + session.instrument.text
    return "; ".join(told) or _NOT_NOTED


def _runs(session: SessionFolder) -> str:
    states = Counter(str(run.state) for run in session.runs)
    return ", ".join(f"{count} {state}" for state, count in sorted(states.items()))


def _bar(bar: Bar | None, waiver: str) -> tuple[tuple[str, str], ...]:
    without = (("measured without a fresh calibration of the bar", waiver),) if waiver else ()
    if bar is None:
        return (("bar", _NOT_NOTED), *without)
    length, _ = to_its_place(bar.calibrated_length_mm, bar.calibrator_uncertainty_mm)
    calibrated = f"{length} mm, u {1e3 * bar.calibrator_uncertainty_mm:.2g} µm"
    when = "" if bar.calibrated is None else f", {bar.calibrated:%Y-%m-%d %H:%M %Z}"
    at = "" if bar.temp_c is None else f", at {_degc(bar.temp_c)}"
    grows = _NOT_NOTED if bar.expansion_um_m_k is None else f"{bar.expansion_um_m_k:g} µm/(m K)"
    of = bar.calibrator_certificate or "certificate without number"
    until = f", valid until {bar.calibrator_valid_until}" if bar.calibrator_valid_until else ""
    certified = (
        f"{of} of {bar.calibrator_certified}{until}" if bar.calibrator_certified else f"certificate {_NOT_NOTED}"
    )
    form = "" if bar.ball_form_um is None else f", form of its ball {bar.ball_form_um:g} µm"
    return (
        ("bar", (bar.serial_number or _NOT_NOTED) + form),
        ("calibrator", f"{bar.calibrator_serial_number or _NOT_NOTED}, {certified}"),
        ("bar calibrated", calibrated + when + at),
        ("thermal expansion of the bar", grows),
        *without,
    )


def _shop(session: SessionFolder) -> str:
    before = _degc(session.ambient_temp_c)
    last = max(starts_of(session.runs), default=None)
    after = [
        note for note in session.notes if note.ambient_temp_c is not None and last is not None and note.made >= last
    ]
    return f"{before} before, {_degc(after[-1].ambient_temp_c)} after" if after else before


def _noted(note: Note) -> str:
    shop = "" if note.ambient_temp_c is None else f"shop at {_degc(note.ambient_temp_c)}"
    return f"{note.made:%Y-%m-%d %H:%M %Z}: {'; '.join(part for part in (note.text, shop) if part)}"


def _degc(value: float | None) -> str:
    return _NOT_NOTED if value is None else f"{value:.1f} °C"


def _logged(circles: Sequence[MeasuredCircle]) -> str:
    ranges: dict[str, tuple[float, float]] = {}
    for one in circles:
        logged = {} if one.analysis is None else one.analysis.raw.temperature_degc
        for name, values in logged.items():
            low, high = float(values.min()), float(values.max())
            before = ranges.get(name, (low, high))
            ranges[name] = min(low, before[0]), max(high, before[1])
    told = [f"{name} {low:.1f} to {high:.1f} °C" for name, (low, high) in sorted(ranges.items())]
    return ", ".join(told) or "none"


def _seal(session: SessionFolder) -> str:
    if session.seal is None:
        return "none"
    events = "" if session.seal.log is None else f", {session.seal.log.events} events"
    told = f"{session.seal.runs} sealed runs{events}"
    anchor = anchor_of(session.seal)
    return f"{told}, anchor {anchor or 'none'}; unbroken when this was written"
