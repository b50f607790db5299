"""The mark of a compensated program in the last decimals of its poses, its checksum, and their recognition.

Each pose is moved by the last decimal of its angles, or of X, Y and Z if the angles are constant, until a hash of its
six numbers begins with `BITS` zero bits. The mark survives edits of comments, line numbers and feeds, and added or
deleted lines. Fewer decimals or shifted poses destroy it.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import bdtrc

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.errors import StationError
from dbbstation.nc.dialect import already_compensated, plain, says_compensated
from dbbstation.nc.spilled import Spilled
from dbbstation.nc.toolpath import DECIMALS, RowKind, in_last_decimals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.toolpath import Toolpath

    _Blocks = Callable[[], Iterator[NDArray[np.uint64]]]


BITS = {2: 16, 3: 11, 4: 7}
"""Number of zero bits of the hash, by the number of poses that can carry the mark; 4 means four and more. One pose in 2 to this power has the mark by chance. More bits move poses farther."""

BY_CHANCE = 5e-9
"""Probability that an uncompensated program counts as compensated, for each number of bits: together about as rare as a program with its own checksum of eight digits. Two poses with the mark are enough."""

LEAST_WAY_MM, LEAST_TURN_DEG, LEAST_ONLY_TURN_DEG = 1e-3, 1e-6, 1e-3
"""The mark moves an axis only if the axis itself moves by more than this, before and after the pose. A stationary axis must stay stationary, also if a rapid leaves it in another coordinate system. F applies along the path, so a move must keep its time within half a percent."""

STEPS_APART, STEPS_TURNED, STEPS_ONLY_TURNED = 200.0, 1.0, 2000.0
"""The same in last decimals, for dialects with few decimals: one step of X, Y or Z, or nine steps of angles, are then half a percent."""

COARSEST = 2
"""Fewest decimals of other dialects, which may also have marked a program."""

_SAME = 1e-9
"""Numbers that differ by less are equal: poses have fifteen digits."""

_GROUPS = ((slice(0, 3), DECIMALS[0]), (slice(3, 6), DECIMALS[5]))

FARTHEST_PLACE, FARTHEST_ANGLE, FARTHEST_ANGLE_OF_FEW = 1, 3, 9
"""Greatest steps of last decimals: each of X, Y, Z by a nanometre, each of A, B, C by half a nanometre at a point 100
mm from the tip, or 1.5 if few poses are free. If A, B and C are constant, one pose in five has the mark; thirty poses
are then enough."""

_FELT_NM = np.array([1.0, 1.0, 1.0, 0.17, 0.17, 0.17])
"""Motion by one last decimal, for an angle at a point 100 mm from the tip [nm]."""

_ODD = np.array(
    [
        0x9E3779B97F4A7C15,
        0xC2B2AE3D27D4EB4F,
        0x165667B19E3779F9,
        0xD6E8FEB86659FD93,
        0xA0761D6478BD642F,
        0xE7037ED1A0B428DB,
    ],
    dtype=np.uint64,
)
"""Odd numbers of 64 bits with about as many ones as zeros, one for each axis. They identify compensated programs: never change them."""

_SHIFTS, _MIXING = np.array([30, 27, 31], np.uint64), np.array([0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)
"""Constants of the finaliser of SplitMix64 [Steele et al. 2014]."""


def marked(
    toolpath: Toolpath, decimals: Sequence[int] = DECIMALS, *, follows: bool = False, goes_on: bool = False
) -> Toolpath:
    """Return a compensated toolpath, or one of its parts, with marked poses, rounded as in the written program."""
    moves = np.flatnonzero(toolpath.is_move & (toolpath.unknown == 0))
    if not len(moves):
        return toolpath
    numbers = in_last_decimals(toolpath.numbers_written[moves], decimals)
    free = _free(toolpath, moves, decimals)
    free[-1] &= not goes_on
    can = np.flatnonzero(free.any(axis=1))
    # A pose that comes again counts once.
    bits = BITS[4 if follows or goes_on else min(max(len(np.unique(_sums(numbers[can]))), 2), 4)]
    steps = _steps(FARTHEST_ANGLE, 1) if bits == BITS[4] else _steps(FARTHEST_ANGLE_OF_FEW, FARTHEST_ANGLE_OF_FEW)
    fixed, moved = _as_bits(~free[can]), _as_bits(steps != 0)
    chosen = _first_marked(_sums(numbers[can]), fixed, _sums(steps), moved, np.uint64(64 - bits))
    numbers[can] += np.where(chosen[:, None] < 0, 0, steps[chosen])
    written = toolpath.numbers_written
    written[moves] = numbers / 10.0 ** np.array(decimals)
    done = toolpath.with_numbers(written)
    poses = done.poses
    # Rows between moves stand where the move before them ended.
    before = np.searchsorted(moves, np.arange(len(poses)), side="right") - 1
    stands = ~toolpath.is_move & (before >= 0)
    poses[stands] = poses[moves[before[stands]]]
    return done


def is_marked(toolpath: Toolpath) -> bool:
    """Return whether more poses are marked than chance explains."""
    tried = list(decimals_of(toolpath))
    least = [min(decimals[first] for decimals in tried) for first in (0, 3)]
    sums = Spilled((np.uint64, 2))
    for numbers in _known(toolpath):
        groups = zip(_GROUPS, least, strict=True)
        sums.add(
            np.column_stack([_sums(in_last_decimals(numbers[:, axes], (n,) * 3), axes) for (axes, _), n in groups])
        )

    def sums_with(decimals: Sequence[int]) -> _Blocks:
        # A number with few decimals continues with zeros.
        further = np.array([10 ** (decimals[0] - least[0]), 10 ** (decimals[3] - least[1])], np.uint64)
        return lambda: (block @ further for block in sums.blocks())

    count = _distinct(sums_with(DECIMALS), len(sums))
    return any(has_marks(sums_with(decimals), len(sums), count) for decimals in tried)


def has_marks(sums: _Blocks, most: int, count: int | None = None) -> bool:
    """Return whether more poses are marked than chance explains.

    Args:
        sums: yields `sums_of` successive poses.
        most: number of poses.
        count: number of different poses; None: to be counted.
    """
    count = _distinct(sums, most) if count is None else count
    hits = Spilled(np.uint64)
    for block in sums():
        hits.add(_with_mark(block, min(BITS.values())))
    numbers = {
        bits: _distinct(lambda bits=bits: (_with_mark(block, bits) for block in hits.blocks()), len(hits))  # type: ignore[misc]
        for bits in BITS.values()
    }
    return any(number and float(bdtrc(number - 1, count, 0.5**bits)) < BY_CHANCE for bits, number in numbers.items())


def _with_mark(sums: NDArray[np.uint64], bits: int) -> NDArray[np.uint64]:
    return sums[_marks(sums, np.uint64(64 - bits))]


def sums_of(toolpath: Toolpath, decimals: Sequence[int]) -> NDArray[np.uint64]:
    """Return a sum of each pose's numbers that identifies the pose, shape (k,)."""
    return np.concatenate([_sums(in_last_decimals(each, decimals)) for each in _known(toolpath)])


def _known(toolpath: Toolpath) -> Iterator[Floats]:
    for part in toolpath.parts():
        yield part.numbers_written[part.is_move & (part.unknown == 0)]


SORTED_TOGETHER = 1 << 19
"""Greatest number of sums that are sorted together."""


def _distinct(sums: _Blocks, most: int) -> int:
    # A sort takes a fifth of the time of NumPy's `unique`, which hashes. Equal sums have equal digits in the middle.
    shares = 1 << (most // SORTED_TOGETHER).bit_length()
    share, middle, count = np.uint64(shares - 1), np.uint64(20), 0
    for number in range(shares):
        some = [block[(block >> middle) & share == number] if shares > 1 else block for block in sums()]
        ordered = np.sort(np.concatenate(some)) if some else np.zeros(0)
        count += int(np.count_nonzero(np.diff(ordered))) + bool(len(ordered))
    return count


def decimals_of(toolpath: Toolpath) -> Iterator[tuple[int, ...]]:
    """Yield the decimals in which a dialect may have written the poses, this program's first."""
    yield DECIMALS
    least = [COARSEST] * len(_GROUPS)
    for numbers in _known(toolpath):
        for group, (axes, most) in enumerate(_GROUPS):
            while least[group] <= most and _off(numbers[:, axes], least[group]) >= _SAME:
                least[group] += 1
    enough = [range(fewest, most + 1) for fewest, (_, most) in zip(least, _GROUPS, strict=True)]
    yield from (found for mm in enough[0] for deg in enough[1] if (found := (mm,) * 3 + (deg,) * 3) != DECIMALS)


def _off(numbers: Floats, decimals: int) -> float:
    return float(np.abs(numbers - np.round(numbers, decimals)).max(initial=0.0))


def _as_bits(axes: Flags) -> Integers:
    return axes @ (1 << np.arange(6))


@compiled
def _first_marked(
    sums: NDArray[np.uint64],
    fixed: Integers,
    step_sums: NDArray[np.uint64],
    moved: Integers,
    unread: np.uint64,
) -> Integers:
    """Return the first step that marks each row without moving a fixed axis, -1 if none, shape (n,)."""
    chosen = np.full(len(sums), -1)
    for row in range(len(sums)):
        for step in range(len(step_sums)):
            if moved[step] & fixed[row]:
                continue
            if _mixed(sums[row] + step_sums[step]) >> unread == 0:
                chosen[row] = step
                break
    return chosen


def _sums(numbers: Integers, axes: slice = slice(None)) -> NDArray[np.uint64]:
    return numbers.astype(np.uint64) @ _ODD[axes]


@compiled
def _marks(sums: NDArray[np.uint64], unread: np.uint64) -> Flags:
    """Return whether the fourth shift leaves zero of each hash, shape (n,)."""
    found = np.zeros(len(sums), dtype=np.bool_)
    for row in range(len(sums)):
        found[row] = _mixed(sums[row]) >> unread == 0
    return found


@inlined
def _mixed(mixed: np.uint64) -> np.uint64:
    mixed = (mixed ^ (mixed >> _SHIFTS[0])) * _MIXING[0]
    mixed = (mixed ^ (mixed >> _SHIFTS[1])) * _MIXING[1]
    return mixed ^ (mixed >> _SHIFTS[2])


def _free(toolpath: Toolpath, moves: Integers, decimals: Sequence[int]) -> Flags:
    poses = toolpath.poses[moves]
    way = np.abs(np.diff(poses, axis=0))
    tips = way[:, :3].max(axis=1) > 0.0
    least = np.where(tips[:, None], [LEAST_WAY_MM] * 3 + [LEAST_TURN_DEG] * 3, [np.inf] * 3 + [LEAST_ONLY_TURN_DEG] * 3)
    steps = np.where(tips[:, None], [STEPS_APART] * 3 + [STEPS_TURNED] * 3, STEPS_ONLY_TURNED)
    moving: Flags = way > np.maximum(least, 0.99 * steps / 10.0 ** np.array(decimals))
    free = np.ones(poses.shape, dtype=np.bool_)
    free[:-1] &= moving
    free[1:] &= moving
    free[0] &= toolpath.start is None or np.isnan(toolpath.start)
    return free


@cache
def _steps(angle: int, angle_and_place: int) -> Integers:
    """Return steps of the six last decimals, shape (k, 6), in order of the motion that they cause; the first step is zero."""
    alone, beside = np.arange(-angle, angle + 1), np.arange(-angle_and_place, angle_and_place + 1)
    place = np.arange(-FARTHEST_PLACE, FARTHEST_PLACE + 1)
    both = np.stack(np.meshgrid(*[place] * 3, *[beside] * 3, indexing="ij"), axis=-1).reshape(-1, 6)
    turned = np.stack(np.meshgrid(*[[0]] * 3, *[alone] * 3, indexing="ij"), axis=-1).reshape(-1, 6)
    tried = np.unique(np.vstack([both, turned]), axis=0).astype(np.int64)
    return tried[np.argsort(np.linalg.norm(_FELT_NM * tried, axis=1), kind="stable")]


CHECKSUMS = 99_999_999
"""Line numbers have at most eight digits in LinuxCNC's language: one program in fifty million has its own checksum by chance."""

_MACHINE = re.compile(r"machine\s*[:=]\s*(?P<name>.*\S)\s*", re.IGNORECASE)


class ProgramChecksum:
    """A checksum of moves, dwells and stops in order, with written decimals, over successive parts of a toolpath.

    Comments, feeds, line numbers and units do not count.
    """

    def __init__(self, decimals: Sequence[int] = DECIMALS) -> None:
        self._decimals = decimals
        self._kinds, self._poses, self._dwells = hashlib.sha256(), hashlib.sha256(), hashlib.sha256()

    def add(self, part: Toolpath) -> None:
        """Count the next rows."""
        told = np.isin(part.kind, [RowKind.RAPID, RowKind.FEED, RowKind.DWELL, RowKind.PAUSE])
        counts = part.is_move & (part.unknown == 0)
        poses = np.where(counts[:, None], in_last_decimals(part.numbers_written, self._decimals), 0)
        self._kinds.update(part.kind[told].astype("<i1").tobytes())
        self._poses.update(poses[told].astype("<i8").tobytes())
        self._dwells.update("".join(f"{seconds:.6e} " for seconds in part.dwell_s[part.dwell_s != 0.0]).encode())

    @property
    def number(self) -> int:
        """Return the checksum of all rows so far."""
        digests = (each.digest() for each in (self._kinds, self._poses, self._dwells))
        return 1 + int.from_bytes(hashlib.sha256(b"".join(digests)).digest()[:8]) % CHECKSUMS


def checksum(toolpath: Toolpath, decimals: Sequence[int] = DECIMALS) -> int:
    """Return the checksum of a toolpath."""
    total = ProgramChecksum(decimals)
    for part in toolpath.parts():
        total.add(part)
    return total.number


def check_nominal(toolpath: Toolpath) -> None:
    """Refuse a compensated program.

    Three signs identify it: a comment, the mark in its poses, and the checksum as line number.

    Raises:
        StationError: it is compensated already.
    """
    signs: dict[str, Callable[[], object]] = {
        "says its header": lambda: says_compensated(toolpath),
        "says the checksum in its line numbers": lambda: (
            toolpath.numbers and any(checksum(toolpath, each) in toolpath.numbers for each in decimals_of(toolpath))
        ),
        "say the last decimals of its poses": lambda: is_marked(toolpath),
    }
    for how, is_there in signs.items():
        if is_there():
            raise already_compensated(toolpath.name, how)


def check_machine(toolpath: Toolpath, machine: Machine) -> None:
    """Refuse a program whose header names another machine.

    Raises:
        StationError: names both.
    """
    own = plain(f"machine: {machine.name}")
    for text in _header(toolpath):
        named = _MACHINE.fullmatch(text)
        if named and plain(f"machine: {named['name']}") != own:
            raise StationError(
                f"its header names the machine {named['name']!r}, the model is of {machine.name!r}",
                where=toolpath.name,
                remedy="give the model of that machine, or post the program for this one",
            )


def _header(toolpath: Toolpath) -> Iterator[str]:
    move = toolpath.first_move
    first = len(toolpath) if move is None else move
    return (text for row, text in toolpath.text.items() if row < first and toolpath.kind[row] == RowKind.COMMENT)
