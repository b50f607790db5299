"""Durations in words."""

from __future__ import annotations

_S_PER_MIN, _MIN_PER_H = 60.0, 60


def duration(time_s: float) -> str:
    """Return a time, such as `35 s`, `12 min` or `1 h 05 min`."""
    if time_s < _S_PER_MIN:
        return f"{time_s:.0f} s"
    minutes = round(time_s / _S_PER_MIN)
    return f"{minutes} min" if minutes < _MIN_PER_H else f"{minutes // _MIN_PER_H} h {minutes % _MIN_PER_H:02d} min"
