"""What `program` and `compensate` share: the model, the hashes, what is printed."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import click
import numpy as np

from dbbstation.cli.output import print_json, print_table, say
from dbbstation.cli.provenance import provenance
from dbbstation.cli.unknown_causes import say_unknown_causes, unknown_causes
from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.model import read_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.source_text import decode, read_bytes
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse
from dbbstation.nc.kept import said_acceleration

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.export import Program


def loaded_inverse(model_file: Path, time_s: float | None, source_files: Sequence[Path], largest_mm: float) -> Inverse:
    """Read the model to compensate with; the header will name it and its sessions by hash.

    Raises:
        InputError: every fault of the file with its place.
    """
    identified = read_model(model_file, every_source(source_files))
    origin = {"model file": hashed(model_file)}
    say_unknown_causes(identified.model)
    origin |= {f"cause unknown {k}": name for k, name in enumerate(unknown_causes(identified.model), start=1)}
    origin |= {f"session {name}": f"sha256 {digest}" for name, digest in identified.sessions.items()}
    return Inverse(identified.model, origin, time_s, identified, largest_mm)


def origin_of(named: Mapping[str, Path], inverse: Inverse | None) -> dict[str, str]:
    """Return what the header of a program says of its origin: files by their part in it, program, command, other inputs.

    Args:
        named: the files that were given, by what they are.
        inverse: the model to compensate with, which says in the header where it comes from by itself.

    Raises:
        InputError: a file cannot be read.
    """
    files = {what: hashed(path) for what, path in named.items()}
    return {**files, **provenance().comments({**files, **({} if inverse is None else inverse.origin)})}


def hashed(path: Path) -> str:
    """Return a file's name and SHA-256, without its folder: the same file gives the same program anywhere.

    Raises:
        InputError: it cannot be read.
    """
    return f"{path.name}, sha256 {hashlib.sha256(_content(path)).hexdigest()}"


def read_source(path: Path) -> str:
    """Return the text of a program.

    Raises:
        InputError: it cannot be read, or is not UTF-8.
    """
    faults: list[Problem] = []
    text = decode(_content(path), str(path), faults)
    if text is None:
        raise InputError(faults)
    return text


def parsed_pose(text: str) -> NDArray[np.float64]:
    """Return the pose, shape (6,) [mm, deg], that `X,Y,Z,A,B,C` says."""
    try:
        pose = np.array([float(number) for number in text.split(",")])
    except ValueError:
        pose = np.empty(0)
    if pose.shape != (6,) or not np.isfinite(pose).all():
        raise click.BadParameter("six numbers with commas between them are needed", param_hint="--start")
    return pose


def preferred(name: str | None) -> Prefer | None:
    """Return what `--prefer` says."""
    return None if name is None else Prefer(name)


def print_programs(
    written: Sequence[tuple[Path, Program]],
    dialect: Dialect,
    machine: Machine | None,
    model_file: Path | None,
    *,
    as_json: bool,
) -> None:
    """Print what was written, as a table or as JSON, and for compensated programs what the machine accelerates with."""
    if dialect.look_ahead is None:
        machine = None
    if not as_json:
        rows = [
            [
                str(path),
                each.points,
                *map(
                    _or_empty, (each.greatest_um, each.uncertainty_um, each.chord_um, each.feed_s, each.nominal_feed_s)
                ),
            ]
            for path, each in written
        ]
        correction = ["greatest correction / µm", "model's u along the path / µm"]
        print_table(["program", "points", *correction, "chord error / µm", "time at feed / s", "nominal / s"], rows)
        for path, each in written:
            if each.cost:
                say(f"{path}: {each.cost}")
        if machine is not None:
            say(f"pieces are chosen for {dialect.name} at {said_acceleration(machine)}")
        _say_uncertainty([each for _, each in written])
        return
    print_json(
        {
            "dialect": dialect.name,
            "model_sha256": None if model_file is None else hashlib.sha256(_content(model_file)).hexdigest(),
            "acceleration_mm_s2": None if machine is None else machine.planned_acceleration_mm_s2,
            "acceleration_known": None if machine is None else machine.acceleration_mm_s2 is not None,
            "programs": [
                {
                    "file": str(path),
                    "sha256": hashlib.sha256(each.text.encode()).hexdigest(),
                    "points": each.points,
                    "greatest_correction_um": each.greatest_um,
                    "chord_error_um": each.chord_um,
                    "chord_asked_um": each.chord_asked_um,
                    "model_uncertainty_um": each.uncertainty_um,
                    "model_uncertainty_by_axis_um": dict(zip("xyz", each.uncertainty_by_axis_um, strict=False)) or None,
                    "model_uncertainty_not_known_because": each.why_unknown or None,
                    "tilt_left_um": each.tilt_left_um,
                    "feed_s": each.feed_s,
                    "nominal_feed_s": each.nominal_feed_s,
                }
                for path, each in written
            ],
        }
    )


def _or_empty(value: float | None) -> float | str:
    return "" if value is None else value


def _say_uncertainty(programs: Sequence[Program]) -> None:
    """Set what the model knows of the paths, where it knows least, against the chord error that was asked for."""
    for why in dict.fromkeys(each.why_unknown for each in programs if each.why_unknown):
        say(f"how well the model knows the path is not known in every coordinate: {why}")
    uncertain_um = max((each.uncertainty_um for each in programs if each.uncertainty_um is not None), default=None)
    asked_um = next((each.chord_asked_um for each in programs if each.chord_asked_um is not None), None)
    if uncertain_um is None or asked_um is None:
        return
    knows = f"the model knows the path within {uncertain_um:.2g} µm (standard uncertainty)"
    asked = f"the chord error asked for is {asked_um:g} µm"
    if uncertain_um > asked_um:
        asked += ": moves are split finer than the model knows them"
    say(f"{knows}, {asked}")


def _content(path: Path) -> bytes:
    faults: list[Problem] = []
    data = read_bytes(path, faults)
    if data is None:
        raise InputError(faults)
    return data
