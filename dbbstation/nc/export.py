"""Nominal and compensated programs as text, checked against the machine's travel, with remarks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Annotated

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.errors import StationError
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.machine.geometry import check_joints
from dbbstation.model.identified import position_uncertainty_mm
from dbbstation.nc.compensate import Compensation, Prefer, compensated_parts
from dbbstation.nc.curve import felt_mm
from dbbstation.nc.dialect import COMPENSATED
from dbbstation.nc.limits import CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.nc.mark import ProgramChecksum, check_machine, check_nominal, has_marks, marked, sums_of
from dbbstation.nc.planner import Planner
from dbbstation.nc.reach import STEP_DEG as REACH_DEG
from dbbstation.nc.reach import STEP_MM as REACH_MM
from dbbstation.nc.reach import check_feeds, check_reach
from dbbstation.nc.setup import offset_text
from dbbstation.nc.spilled import LongText, Spilled
from dbbstation.nc.toolpath import in_pieces
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dbbstation.computing.arrays import Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.toolpath import Toolpath

    _Uncertainty = tuple[float | None, Mapping[str, float | None] | None, str | None]


@dataclass(frozen=True)
class Inverse:
    """The model to compensate with.

    Attributes:
        started_s: start of each program on the time scale of the model's sessions; None if not known.
        identified: the model with its covariance; None if not known.
        largest_mm: greatest correction that is applied [mm].
        strict: refuse a program that exceeds the chord error, or in which the control would not keep a feed.
    """

    model: MachineModel
    origin: Mapping[str, str] = field(default_factory=dict)
    started_s: float | None = None
    identified: IdentifiedModel | None = None
    largest_mm: float = LARGEST_CORRECTION_MM
    prefer: Prefer = Prefer.ACCURACY
    strict: bool = False


@dataclass(frozen=True, kw_only=True)
class Program:
    """One program.

    Attributes:
        file: name, or path once written.
        greatest_correction_um: None in a nominal program.
        chord_error_um: largest distance between a move and its path; None in a nominal program.
        chord_asked_um: None in a nominal program.
        model_uncertainty_um: greatest standard uncertainty of the tool tip along the path; None if unknown.
        model_uncertainty_by_axis_um: None without a model.
        tilt_left_um: tilt correction left out, 100 mm from the tip.
        feed_s: computed time at feed; None for an unknown look-ahead.
    """

    file: str
    sha256: str
    points: int
    greatest_correction_um: float | None = None
    chord_error_um: float | None = None
    chord_asked_um: float | None = None
    model_uncertainty_um: float | None = None
    model_uncertainty_by_axis_um: Mapping[str, float | None] | None = None
    model_uncertainty_not_known_because: str | None = None
    tilt_left_um: float | None = None
    feed_s: float | None = None
    nominal_feed_s: float | None = None
    remarks: tuple[str, ...] = ()
    content: Annotated[LongText, AsItIs, Kept] = field(repr=False)

    @property
    def text(self) -> str:
        """Return the whole program."""
        return str(self.content)


def compensated_program(
    path: Toolpath,
    dialect: Dialect,
    inverse: Inverse,
    *,
    chord_mm: float = CHORD_MM,
    origin: Mapping[str, str] | None = None,
) -> Program:
    """Return a program in compensated form, with its name.

    Raises:
        TravelError: the compensated path leaves the travel.
        KinematicsError: a pose that the machine cannot take.
        ModelError: the model has a source that needs data that a program lacks.
        MachineError: a feed that the machine does not reach.
        StationError: the program is compensated already or for another machine, its corrections are too large, or `strict`
            refuses it.
    """
    machine = inverse.model.machine
    check_nominal(path)
    check_machine(path, machine)
    header = [f"machine: {machine.name}", *named(origin or {}), *_holds_for(path)]

    return written_program(path, machine, dialect, path.name, inverse, chord_mm, header, split=True)


@with_one_thread
def written_program(
    path: Toolpath,
    machine: Machine,
    dialect: Dialect,
    stem: str,
    inverse: Inverse | None,
    chord_mm: float,
    header: list[str],
    *,
    split: bool,
) -> Program:
    """Return the program of a path, compensated if there is an inverse.

    Args:
        stem: of its name.
        split: split moves; otherwise arcs keep their chords.
    """
    name, own = dialect.file_name(stem, path.run), machine.hexapod.rotation
    path = replace(path, rotation=path.rotation or own)
    check_reach(machine, path)
    check_feeds(machine, path)
    order = dialect.rotation or own
    written = path.in_order(order)
    if inverse is None:
        content = LongText.of(dialect.write(written, header))
        return Program(file=name, sha256=content.sha256, points=_points(written), content=content)
    check_joints(inverse.model.machine)
    asked_um, prefer = 1e3 * chord_mm, inverse.prefer
    # The same machine, with angles in the order of the program that is written.
    turned = replace(machine, hexapod=replace(machine.hexapod, rotation=order))
    parts = compensated_parts(
        written,
        replace(inverse.model, machine=turned),
        chord_mm=chord_mm,
        keep_arcs=not split,
        started_s=inverse.started_s,
        largest_mm=inverse.largest_mm,
        planner=planner_of(machine, dialect),
        prefer=prefer,
    )
    done = _Finished(machine, dialect)
    uncertainty = _uncertainty_um(path.in_order(own), inverse)

    def head() -> tuple[list[str], tuple[int, ...]]:
        total = done.total
        said = [*header, *named(inverse.origin), f"{COMPENSATED} {total.greatest_um:.3f} um"]
        said.append(f"chord error asked for {asked_um:g} um, reached {total.chord_um:.3f} um")
        said += remarks_on(total, asked_um, machine, dialect, prefer)
        said += [] if done.is_marked else ["its poses are too few to carry a mark: keep this header"]
        return [*said, *_said_of_uncertainty(*uncertainty)], (done.checksum.number,) * 2

    content = dialect.write_parts(done.finished(parts), head)
    total = done.total
    if inverse.strict:
        check_kept(total, asked_um, machine)
    together_um, by_axis_um, why = uncertainty
    return Program(
        file=name,
        sha256=content.sha256,
        points=done.points,
        greatest_correction_um=total.greatest_um,
        chord_error_um=total.chord_um,
        chord_asked_um=asked_um,
        model_uncertainty_um=together_um,
        model_uncertainty_by_axis_um=by_axis_um,
        model_uncertainty_not_known_because=why,
        tilt_left_um=total.tilt_um,
        feed_s=None if dialect.look_ahead is None else total.seconds,
        nominal_feed_s=None if dialect.look_ahead is None else total.nominal_seconds,
        remarks=remarks_on(total, asked_um, machine, dialect, prefer),
        content=content,
    )


class _Finished:
    """Marks and checks the parts of a compensated program, and keeps what its header states.

    Attributes:
        points: moves so far.
    """

    def __init__(self, machine: Machine, dialect: Dialect) -> None:
        self._machine, self._decimals = machine, dialect.decimals
        self.checksum, self.points = ProgramChecksum(dialect.decimals), 0
        self._so_far: Compensation | None = None
        self._coarse_mm = 0.0
        self._sums = Spilled(np.uint64)

    def finished(self, parts: Iterable[Compensation]) -> Iterator[Toolpath]:
        """Yield the parts as they are written."""
        for part, after in pairwise(chain(parts, [None])):
            if part is None:
                continue
            part_so_far = part if self._so_far is None else Compensation.together([self._so_far, part], part.toolpath)
            finished = marked(part.toolpath, self._decimals, follows=self.points > 0, goes_on=after is not None)
            # What rounding and mark move a pose by is part of how far the tool leaves the path.
            off_mm = felt_mm(finished.poses - part.toolpath.poses)
            self._so_far, self._coarse_mm = part_so_far, max(self._coarse_mm, float(off_mm.max(initial=0.0)))
            check_reach(self._machine, finished)
            self.checksum.add(finished)
            self._sums.add(sums_of(finished, self._decimals))
            self.points += _points(finished)
            yield finished

    @property
    def total(self) -> Compensation:
        """Return the figures of all parts, with the last part's toolpath."""
        if self._so_far is None:
            raise ValueError("no part is finished")
        return replace(self._so_far, chord_um=self._so_far.chord_um + 1e3 * self._coarse_mm)

    @property
    def is_marked(self) -> bool:
        """Return whether the written poses contain the mark."""
        return has_marks(self._sums.blocks, len(self._sums))


def planner_of(machine: Machine, dialect: Dialect) -> Planner:
    """Return the planner of a dialect's control on a machine."""
    return Planner(machine.planned_acceleration_mm_s2, dialect.look_ahead)


UNCERTAIN_AT = 2000
"""Number of poses along the path at which the model's uncertainty is computed: it changes over decimetres."""


def _uncertainty_um(path: Toolpath, inverse: Inverse) -> _Uncertainty:
    if inverse.identified is None:
        return None, None, None
    number = sum(int(_checked_pieces(part).sum()) for part in path.parts())
    some = np.unique(np.linspace(0, number - 1, UNCERTAIN_AT).astype(np.int64))
    poses, times_s, before, begin_s = [], [], 0, 0.0
    for part in path.parts():
        row, share = in_pieces(_checked_pieces(part))
        here = some[np.searchsorted(some, before) : np.searchsorted(some, before + len(row))] - before
        row, share, before = row[here], share[here], before + len(row)
        ends_s = np.cumsum(np.append(begin_s, part.duration_s))
        poses.append(part.between(row, share))
        times_s.append(ends_s[1 + row] - (1.0 - share) * part.duration_s[row])
        begin_s = float(ends_s[-1])
    time_s = None if inverse.started_s is None else inverse.started_s + np.concatenate(times_s)
    motion = Motion(poses=np.concatenate(poses), is_path=True, time_s=time_s)
    per_axis_um = 1e3 * position_uncertainty_mm(inverse.identified, motion)
    together_um = float(np.linalg.norm(per_axis_um, axis=1).max())
    by_axis_um = dict(zip("xyz", map(finite, per_axis_um.max(axis=0).tolist()), strict=True))
    if None in by_axis_um.values():
        return None, by_axis_um, inverse.identified.why_unknown
    return together_um, by_axis_um, None


def _checked_pieces(path: Toolpath) -> Integers:
    """Return the number of pieces of each row, shape (n,); none in rows that are no moves."""
    return np.where(path.is_move, path.pieces(REACH_MM, REACH_DEG), 0)


def _said_of_uncertainty(
    together_um: float | None, by_axis_um: Mapping[str, float | None] | None, why: str | None
) -> list[str]:
    if together_um is not None:
        return [f"standard uncertainty of the model along the path {together_um:.3f} um at most"]
    if by_axis_um is None:
        return []
    each = (f"{axis.upper()} {'not known' if um is None else f'{um:.3f} um'}" for axis, um in by_axis_um.items())
    return [f"standard uncertainty of the model along the path at most: {', '.join(each)}", f"not known because {why}"]


def named(names: Mapping[str, str]) -> list[str]:
    """Return lines of a header that name something."""
    return [f"{what}: {name}" for what, name in names.items()]


def _holds_for(path: Toolpath) -> list[str]:
    if path.holds is None:
        return []
    diameters = {name: values[0] for name, values in path.holds.items() if name[0] == "D"}
    held = {name: offset_text(values) for name, values in path.holds.items() if name not in diameters}
    lengths = {name: held.pop(name) for name in list(held) if name[0] == "H"}
    said = [f"right for {'' if name == 'G92' else 'work system '}{name}: {offset}" for name, offset in held.items()]
    said += [f"right for the length of tool {name[1:]}: {length}" for name, length in lengths.items()]
    said += [f"right for the diameter of tool {name[1:]}: {value:g}" for name, value in diameters.items()]
    return [*said, "after a new touch-off of one of these: compensate again"]


def _points(path: Toolpath) -> int:
    return int(np.count_nonzero(path.is_move))


KEPT = 1.01
"""Ratio of computed to programmed time at feed above which the loss is reported."""


def remarks_on(
    done: Compensation, asked_um: float, machine: Machine, dialect: Dialect, prefer: Prefer
) -> tuple[str, ...]:
    """Return a sentence each on an exceeded chord error, on time lost in short pieces, and on an uncorrected tilt."""
    said = [*done.toolpath.notes]
    if done.chord_um > asked_um:
        said.append(
            f"the path is kept within {up(done.chord_um)} µm, not within {asked_um:g} µm, at {done.toolpath.place(done.chord_line)}: the correction "
            "has a step or bends more than the shortest pieces follow"
        )
    if dialect.look_ahead is None:
        said.append(f"how far {dialect.name} looks ahead is not known: whether it keeps F was not checked")
    elif done.seconds > KEPT * done.nominal_seconds:
        said.append(
            f"about {done.seconds:.0f} s at feed, {done.nominal_seconds:.0f} as written, with {said_acceleration(machine)}"
        )
    if prefer is Prefer.POSITION_ONLY:
        said.append(
            f"A, B and C are not corrected: a tilt is left that is felt as {up(done.tilt_um)} µm 100 mm from the tip"
        )
    return tuple(said)


def check_kept(done: Compensation, asked_um: float, machine: Machine) -> None:
    """Refuse a program that exceeds the chord error or loses a feed, stating values that keep both.

    Raises:
        StationError: names the worst line.
    """
    if done.chord_um > asked_um:
        raise StationError(
            f"the path is kept within {up(done.chord_um)} µm here, not within {asked_um:g} µm",
            where=done.toolpath.place(done.chord_line),
            remedy=f"--chord-um {up(done.chord_um)} is kept everywhere; without --strict the program is written as it is",
        )
    if math.isfinite(done.slowest_mm_min):
        reached = math.floor(done.slowest_mm_min)
        raise StationError(
            f"the control reaches {f'F{reached}' if reached else 'no F'} here, with {said_acceleration(machine)}; the program takes about "
            f"{done.seconds:.0f} s at feed, {done.nominal_seconds:.0f} as written",
            where=done.toolpath.place(done.slowest_line),
            remedy=(f"F{reached} is kept everywhere; " if reached else "")
            + "without --strict the program is written as it is",
        )


def said_acceleration(machine: Machine) -> str:
    """Return the acceleration and its origin as text."""
    known = "of the machine file" if machine.acceleration_mm_s2 is not None else "assumed: the machine file has none"
    return f"the acceleration of {machine.planned_acceleration_mm_s2 / 1e3:g} m/s² ({known})"


def up(value: float) -> str:
    """Return a number with two digits, rounded up."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.4g}"
