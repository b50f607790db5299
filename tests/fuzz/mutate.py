"""Spoils a file: bytes, lines, numbers, words, cells and values of keys; several times over."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Sequence
    from pathlib import Path

FORGED = "no fault at all"
"""What a line begins with that a name with a line feed has forged."""
SOUND = "sound/"
"""Folder of files that commands need beside the spoilt ones and that stay as they are."""

NUMBERS = (
    b"0", b"-0.0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e160", b"1e-160", b"1e15", b"nan", b"inf", b"-inf", b".nan", b"", b"1_000", b"0x10",
    b"0o17", b"1,5", b"9" * 400, b"0." + b"0" * 400 + b"1", b"1e999999", "１２".encode(), "١".encode(), "²".encode(), b"true", b"1:30", b"2026-11-20",
    b"2147483648", b"9223372036854775808", b"1e6", b"1e-6", b"150", b"359.999", b"-90", b"+5", b"5.", b".5", b"--5", b"1e", b"1 2",
)  # fmt: skip
VALUES = (
    b"null", b"~", b"[]", b"{}", b"[1, 2]", b"{a: 1}", b"[[[]]]", b"''", b'""', b"!!python/none x", b"&a x", b"*a", b"|", b">", b"- 1", b"? x",
    b"true", b"no", b"word", b"'two words'", b'"\\x1b]0;title\\x07"', b'"\\0"', b'"\\ud800"', b'"a\\nb"', b'"x\\n%s"' % FORGED.encode(), b"=HYPERLINK(1)", b"../../etc/passwd", b"/dev/zero",
    b".", b"s", b"x" * 3000, "µ".encode(), "\u202e".encode(), b"2026-11-20T08:00:00Z", b"9999-12-31T23:59:59Z", b"0001-01-01T00:00:00+14:00", b"ccw", b"cw",
)  # fmt: skip
SIGNS = (
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\r\n", b"\n", b"\t", b"\x1b[31m", b'"', b"'", b",", b";", b"#", b":", b"%", b"(", b")", b"[", b"]", b"{",
    b"}", b"&", b"*", b"!", b"|", b"-", b"---\n", b"...\n", b"\xc2\x85", b"\xe2\x80\xa8", b"\x0c", b"\xed\xa0\x80", b" ", b"e", b".",
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w-]*")
_VALUE = re.compile(rb"(?<=: )[^,}\]\n]+")
LARGEST = 200_000
"""Bytes that a spoilt file grows to at the most."""


def spoil(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    for _ in range(1 if rng.random() < 0.5 else rng.randint(2, 8)):
        data = rng.choices(_WAYS, _SHARES)[0](data, rng, others)[:LARGEST]
    return data


def _swap(pattern: re.Pattern[bytes], instead: Sequence[bytes]) -> Callable[..., bytes]:
    def change(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
        places = [match.span() for match in pattern.finditer(data)]
        if not places:
            return data + rng.choice(instead)
        start, end = rng.choice(places)
        return data[:start] + rng.choice(instead) + data[end:]

    return change


def _digits(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    places = [match.span() for match in _NUMBER.finditer(data)]
    if not places:
        return data
    start, end = rng.choice(places)
    number = data[start:end]
    new = rng.choice(
        [
            number + b"e%d" % rng.randint(-320, 320),
            b"-" + number,
            number[1:],
            number + b"0",
            b"%d" % rng.randint(-9, 99),
        ]
    )
    return data[:start] + new + data[end:]


def _bytes(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    at, length = rng.randint(0, len(data)), rng.choice([0, 1, 1, 2, 5, 30, 300])
    new = rng.choice([b"", rng.choice(SIGNS), rng.randbytes(rng.randint(1, 8)), data[at : at + length] * 2])
    return data[:at] + new + data[at + length :]


def _cut(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    at = rng.randint(0, len(data))
    return rng.choice([data[:at], data[at:], data[:at] + bytes(rng.randint(1, 600))])


def _lines(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    lines = data.split(b"\n")
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(7)
    if way == 0:
        del lines[at]
    elif way == 1:
        lines[at:at] = [lines[at]] * rng.choice([1, 2, 50])
    elif way == 2:
        lines[at], lines[to] = lines[to], lines[at]
    elif way == 3:
        lines[at] = rng.choice([b" ", b"    ", b"\t", b"- ", b"# "]) + lines[at]
    elif way == 4:
        lines[at] = lines[at].lstrip()
    elif way == 5:
        del lines[min(at, to) : max(at, to)]
    else:
        lines[at] = rng.choice(rng.choice(others).split(b"\n"))
    return b"\n".join(lines)


def _column(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    """A whole column of a table: scaled, constant, empty, taken away, doubled, or its name alone."""
    lines = data.split(b"\n")
    sign = max((b",", b";", b"\t"), key=data.count)
    rows = [at for at, line in enumerate(lines) if sign in line and not line.startswith(b"#")]
    if not rows:
        return data
    k = rng.randrange(lines[rows[0]].count(sign) + 1)
    way, power, value = (
        rng.randrange(6),
        rng.choice([-300, -160, -30, -9, -3, 3, 6, 9, 30, 160, 300]),
        rng.choice(NUMBERS),
    )
    for at in rows if way < 5 else rows[:1]:
        cells = lines[at].split(sign)
        if k >= len(cells) or (at == rows[0] and way < 3):
            continue
        if way == 0:
            cells[k] += b"e%d" % power
        elif way in {1, 2}:
            cells[k] = value if way == 1 else b""
        elif way == 3:
            del cells[k]
        elif way == 4:
            cells.insert(k, cells[k])
        else:
            cells[k] = rng.choice([*VALUES, *cells])
        lines[at] = sign.join(cells)
    return b"\n".join(lines)


def _deep(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    """Nesting deeper than any parser recurses."""
    at, (first, last) = (
        rng.randint(0, len(data)),
        rng.choice([(b"[", b"]"), (b"{a: ", b"}"), (b"(", b")"), (b"-", b""), (b"- ", b"")]),
    )
    depth = rng.choice([50, 900, 20_000])
    return data[:at] + first * depth + b"1" + last * rng.choice([0, depth]) + data[at:]


def _wide(data: bytes, rng: random.Random, _others: Sequence[bytes]) -> bytes:
    """Some thousand columns more."""
    lines = data.split(b"\n")
    sign = max((b",", b";", b"\t"), key=data.count)
    count, at = rng.choice([300, 9_000]), rng.randrange(3)
    for row, line in enumerate(lines[:20]):
        cells = line.split(sign)
        if len(cells) > 1 and not line.startswith(b"#"):
            more = [b"%s%d" % (cells[0], k) if row <= at else cells[-1] for k in range(count)]
            lines[row] = sign.join([*cells, *more])
    return b"\n".join(lines)


def disturb(folder: Path, rng: random.Random) -> None:
    """Change which files there are in a folder, as a power cut, a sync or a stranger does."""
    for _ in range(rng.choice([1, 1, 2, 4])):
        files = [path for path in sorted(folder.rglob("*")) if path.is_file() and SOUND not in path.as_posix()]
        if files:
            rng.choice(_DISTURBANCES)(rng.choice(files), rng.choice(files), rng)


def _stand_in(one: Path, other: Path, rng: random.Random) -> None:
    one.unlink()
    if rng.random() < 0.3:
        one.mkdir()
    else:
        one.symlink_to(rng.choice([one.name, other.name, "/dev/zero", "..", "missing"]))


def _renamed(one: Path, _other: Path, rng: random.Random) -> None:
    names = (f"{one.name}.part", f".{one.name}.x.new", f"x\n{FORGED}", "s[1]", "-a", "a b", f"{one.stem}-2{one.suffix}")
    one.rename(one.with_name(rng.choice(names)))


def _stranger(one: Path, other: Path, rng: random.Random) -> None:
    names = (
        ".lock",
        "worked-out.json",
        "dbbstation-settings.yaml",
        "fleet.json",
        "json.py",
        "events.log",
        "session.yaml",
    )
    place = rng.choice([one, other]).parent / rng.choice((*names, f".{one.name}.{rng.randrange(99)}.new"))
    if not place.is_dir():
        content = (b"", b"{}", b"[" * 900, b"format: dbb-settings/1\n", rng.randbytes(40), one.read_bytes()[:200])
        place.write_bytes(rng.choice(content))


_DISTURBANCES: tuple[Callable[..., object], ...] = (
    lambda one, *_: one.unlink(),
    lambda one, other, _rng: one.write_bytes(other.read_bytes()),
    lambda one, _other, rng: one.write_bytes(one.read_bytes()[: rng.randrange(one.stat().st_size + 1)]),
    _stand_in,
    _renamed,
    _stranger,
    _stranger,
)


def _splice(data: bytes, rng: random.Random, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others)
    return data[: rng.randint(0, len(data))] + other[rng.randint(0, len(other)) :]


_WAYS: tuple[Callable[..., bytes], ...] = (
    _swap(_NUMBER, NUMBERS), _digits, _swap(_VALUE, VALUES), _swap(_WORD, VALUES), _bytes, _cut, _lines, _column, _splice, _deep, _wide,
)  # fmt: skip
_SHARES = (5, 4, 5, 2, 5, 1, 4, 2, 0.5, 0.5, 0.3)
