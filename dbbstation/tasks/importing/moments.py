"""Find the time of a recording from a column, from lines above the table, or from the file's name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from dbbstation.text.written import words

if TYPE_CHECKING:
    from collections.abc import Mapping

DATE_KEYS = words("started, start, date, datum, datetime, date/time, date time, test date, measured, begin")
"""Keys of lines above a table with its date, in small letters; the first one found counts."""

TIME_KEYS = ("time", "uhrzeit", "zeit", "start time", "startzeit", "test time")
"""Keys of lines with the time of day, if the date has none."""

_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_GERMAN = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_DATES = (
    r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})",
    r"(?P<y>20\d{2})(?P<m>\d{2})(?P<d>\d{2})",
    r"(?P<d>\d{1,2})\.\s?(?P<m>\d{1,2})\.(?P<y>\d{4})",
    r"(?P<first>\d{1,2})/(?P<second>\d{1,2})/(?P<y>\d{4})",
    r"(?P<d>\d{1,2})[. -]+(?P<word>[^\W\d_]{3,9})[. ,-]+(?P<y>\d{4})",
    r"(?P<word>[^\W\d_]{3,9})[. ]+(?P<d>\d{1,2}),?\s+(?P<y>\d{4})",
)
_CLOCK = (
    r"(?P<H>\d{1,2})[:.h-](?P<M>\d{2})(?:[:.-](?P<S>\d{2})(?:[.,](?P<f>\d{1,6})\d*)?)?\s*(?P<half>[AaPp][Mm])?",
    r"(?P<H>\d{2})(?P<M>\d{2})(?P<S>\d{2})?",
)
_ZONE = r"\s*(?P<zone>Z|UTC|[+-]\d{2}:?\d{2})?"
_IN_A_NAME = re.compile(
    r"(?<!\d)(20\d{2})[-_.]?([01]\d)[-_.]?([0-3]\d)(?:[T_ -]([0-2]\d)[-_.:h]?([0-5]\d)(?:[-_.:]?([0-5]\d))?)?(?!\d)"
)


class UnclearMomentError(ValueError):
    """A date that is invalid or ambiguous."""

    def __init__(self, what: str, key: str = "") -> None:
        self.what, self.key = what, key
        super().__init__(what)


@dataclass(frozen=True)
class Moment:
    """The time of a recording.

    Attributes:
        assumed: assumptions beyond the text, in words; may be empty.
    """

    at: datetime
    assumed: tuple[str, ...] = ()


def zone_named(text: str) -> tzinfo:
    """Return the zone `+01:00`, `UTC` or `Europe/Berlin`.

    Raises:
        UnclearMomentError: an unknown zone.
    """
    offset = re.fullmatch(r"([+-])(\d{2}):?(\d{2})", text)
    if offset:
        minutes = 60 * int(offset[2]) + int(offset[3])
        return timezone(timedelta(minutes=minutes if offset[1] == "+" else -minutes))
    if text in {"Z", "UTC"}:
        return UTC
    try:
        return ZoneInfo(text)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise UnclearMomentError(f"`{text}` is no time zone: write such as +01:00 or Europe/Berlin") from error


def moment_in(text: str, zone: tzinfo | None) -> Moment:
    """Return the moment of a text.

    Args:
        text: such as `2026-11-20T08:04:11Z`, `20.11.2026 08:04` or `Nov 20, 2026`.
        zone: default; None: this computer's.

    Raises:
        UnclearMomentError: it is no date, or day and month are ambiguous.
    """
    plain = text.strip().strip('"')
    for date in _DATES:
        for clock in _CLOCK:
            found = re.fullmatch(rf"{date}(?:(?:\s*[,T_]\s*|\s+){clock}{_ZONE})?", plain)
            if found:
                return _moment(found.groupdict(), plain, zone)
    raise UnclearMomentError(f"`{plain}` is no date")


def moment_of(in_column: str, comments: Mapping[str, str], stem: str, zone: str | None) -> Moment | None:
    """Return when a run was recorded: by column, lines above the table, or file name; else None.

    Args:
        comments: lines above the table, by key in small letters.
        zone: default; None: this computer's.

    Raises:
        UnclearMomentError: column or line is unclear.
    """
    known = None if zone is None else zone_named(zone)
    if in_column:
        return moment_in(in_column, known)
    above = moment_above(comments, known)
    if above is not None:
        key, found = above
        return Moment(found.at, (f"date: from the line `{key}` above the table", *found.assumed))
    named = moment_in_name(stem, known)
    return None if named is None else Moment(named.at, ("date: from the name of the file", *named.assumed))


def moment_above(comments: Mapping[str, str], zone: tzinfo | None) -> tuple[str, Moment] | None:
    """Return key and moment of the lines above a table, or None.

    Raises:
        UnclearMomentError: such a line is unclear.
    """
    key = next((one for one in DATE_KEYS if one in comments), None)
    if key is None:
        return None
    text = comments[key]
    clock = next((comments[one] for one in TIME_KEYS if one in comments), "")
    if clock and not re.search(r"\d\d?[:.h]\d\d", text.partition(" ")[2]) and re.match(r"\d{1,2}[:.]\d{2}", clock):
        text = f"{text} {clock}"
    try:
        return key, moment_in(text, zone)
    except UnclearMomentError as error:
        raise UnclearMomentError(error.what, key) from error


def moment_in_name(stem: str, zone: tzinfo | None) -> Moment | None:
    """Return the moment in a file name, such as `a_ccw_2026-11-20_0804`, or None."""
    found = _IN_A_NAME.search(stem)
    if found is None:
        return None
    keys = ("y", "m", "d", "H", "M", "S")
    try:
        return _moment(dict(zip(keys, found.groups(), strict=True)), stem, zone)
    except UnclearMomentError:
        return None


def _moment(parts: Mapping[str, str | None], text: str, zone: tzinfo | None) -> Moment:
    day, month = _day_and_month(parts, text)
    hour = int(parts.get("H") or 0)
    if half := parts.get("half"):
        hour = hour % 12 + (12 if half.lower() == "pm" else 0)
    micro = int((parts.get("f") or "0").ljust(6, "0"))
    try:
        at = datetime(  # noqa: DTZ001 - its zone is told below
            int(parts["y"] or 0), month, day, hour, int(parts.get("M") or 0), int(parts.get("S") or 0), micro
        )
    except ValueError as error:
        raise UnclearMomentError(f"`{text}` is no date: {error}") from error
    assumed = [] if parts.get("H") else [f"`{text}` has no time of day: 00:00 is noted"]
    if said := parts.get("zone"):
        return Moment(at.replace(tzinfo=zone_named(said)), tuple(assumed))
    if zone is not None:
        return Moment(at.replace(tzinfo=zone), tuple(assumed))
    local = at.astimezone()
    assumed.append(f"dates have no time zone: that of this computer is taken, UTC{local:%z} (--zone says otherwise)")
    return Moment(local, tuple(assumed))


def _day_and_month(parts: Mapping[str, str | None], text: str) -> tuple[int, int]:
    if word := parts.get("word"):
        start = word.lower()[:3]
        month = _MONTHS.index(start) + 1 if start in _MONTHS else _GERMAN.get(start, 0)
        if not month:
            raise UnclearMomentError(f"`{text}` is no date: there is no month `{word}`")
        return int(parts["d"] or 0), month
    if parts.get("first"):
        one, other = int(parts["first"] or 0), int(parts["second"] or 0)
        if one <= 12 and other <= 12 and one != other:  # noqa: PLR2004 - months of a year
            raise UnclearMomentError(f"`{text}` may be the {one}. of month {other} or the {other}. of month {one}")
        return (one, other) if other <= 12 else (other, one)  # noqa: PLR2004
    return int(parts["d"] or 0), int(parts["m"] or 0)
