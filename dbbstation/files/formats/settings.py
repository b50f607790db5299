"""The shop's settings, each with its file and line."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dbbstation.errors import Problem, refuse

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from dbbstation.files.formats.settings_schema import SettingsFile
    from dbbstation.files.yaml.text import YamlDocument
    from dbbstation.plan.tolerance import Tolerance

BESIDE = "dbbstation-settings.yaml"
"""Name of the file beside sessions."""

OF_USER = "settings.yaml"
"""Name of the file in the user's configuration folder."""

_OPEN = frozenset({"program", "limits", "report"})
"""Blocks with independent keys, which several files may state. Every other block describes one thing, such as one bar,
and comes from one file as a whole."""

_PART_OF = {"profile": "instrument"}
"""Keys that depend on another key, and apply only if both come from the same file."""

_PROTOCOL_ENDINGS = (".yaml", ".yml")


@dataclass(frozen=True)
class Setting:
    """One value.

    Attributes:
        line: from 1.
    """

    value: Any
    file: Path
    line: int

    @property
    def origin(self) -> str:
        """Return file and line, with a colon between."""
        return f"{self.file}:{self.line}"


@dataclass(frozen=True)
class Settings:
    """Values that apply, from several files.

    Attributes:
        values: by dotted key, such as `limits.largest_correction_mm`; absent if not stated.
        tolerances_from: `file:line`; empty if no file states them.
        files: the strongest first.
    """

    values: Mapping[str, Setting] = field(default_factory=dict)
    tolerances: tuple[Tolerance, ...] = ()
    tolerances_from: str = ""
    files: tuple[Path, ...] = ()


def settings_files(beside: Path) -> list[Path]:
    """Return existing settings files, the strongest first: the file in `beside`, then the user's."""
    import platformdirs  # noqa: PLC0415 - only commands that take settings look for them

    user = platformdirs.user_config_path("dbbstation", appauthor=False, roaming=True) / OF_USER
    return [path for path in (beside / BESIDE, user) if path.is_file()]


def read_settings(files: Iterable[Path]) -> Settings:
    """Read settings files; earlier ones override later ones.

    Raises:
        InputError: every fault with its place.
    """
    paths, faults = tuple(files), list[Problem]()
    if not paths:
        return Settings()
    from dbbstation.files.formats.settings_schema import SettingsFile  # noqa: PLC0415 - without a file, nothing to validate
    from dbbstation.files.yaml.schema import read_valid  # noqa: PLC0415 - the same

    read = [read_valid(path, SettingsFile, faults) for path in paths]
    refuse(faults)
    values: dict[str, Setting] = {}
    tolerances: tuple[Tolerance, ...] = ()
    told = ""
    for path, found in zip(paths, read, strict=True):
        if found is None:
            continue
        document, file = found
        blocks = {key.partition(".")[0] for key in values} - _OPEN
        own = {key: Setting(value, path, _line(document, key)) for key, value in _flat(file, path)}
        taken = set(values)
        values |= {
            key: one
            for key, one in own.items()
            if not taken & {key, _PART_OF.get(key)} and key.partition(".")[0] not in blocks
        }
        if file.tolerances is not None and not told:
            tolerances = tuple(one.to_domain() for one in file.tolerances)
            told = f"{path}:{_line(document, 'tolerances')}"
    return Settings(values, tolerances, told, paths)


def _flat(file: SettingsFile, path: Path) -> Iterable[tuple[str, Any]]:
    data = file.model_dump(exclude_unset=True, exclude_none=True, exclude={"format", "tolerances"})
    for key, value in data.items():
        if isinstance(value, dict):
            yield from ((f"{key}.{inner}", each) for inner, each in value.items())
        elif key == "instrument" and value.endswith(_PROTOCOL_ENDINGS):
            yield key, str(path.parent / value)
        elif key != "simulators" or path.name != BESIDE:  # a folder that was handed over allows nothing by itself
            yield key, value


def _line(document: YamlDocument, key: str) -> int:
    place = tuple(key.split("."))
    places = document.key_places
    return places.get(place, places.get(place[:1], (1, 1)))[0]
