"""Pictures of the screen in frozen states, compared with those that were looked at and kept.

    DBBSTATION_KEEP_STILLS=1 pytest tests/tui/test_stills.py

keeps new ones; look at them before committing.
"""

from __future__ import annotations

import asyncio
import html
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan.plan import Direction
from dbbstation.quality.finding import Name, found, undecided
from dbbstation.station.commands import Accept
from dbbstation.tui.app import DARK, LIGHT
from tests.tui.happenings import Happening
from tests.tui.still import still_svg

if TYPE_CHECKING:
    from collections.abc import Callable

KEPT = Path(__file__).parent / "stills"
KEEP = bool(os.environ.get("DBBSTATION_KEEP_STILLS"))


def set_up() -> Happening:
    return Happening()


def second_circle() -> Happening:
    return Happening().circle("t0", Direction.CCW).command(Accept()).circle("t0", Direction.CW, 0.6)


def verdict() -> Happening:
    return Happening().circle("t0", Direction.CCW).command(Accept()).circle("t0", Direction.CW)


def findings() -> Happening:
    told = (
        found(Name.NOISE, 0.31, 0.61, "sound", "noisy"),
        undecided(Name.REPEAT, "there is no other run of this test"),
        found(Name.CLOSURE, 4.1, 1.95, "sound", "the ends are 4.1 µm apart; was the ball touched?"),
    )
    return Happening(findings=told).circle("t0", Direction.CCW)


def fault() -> Happening:
    happening = Happening().circle("t0", Direction.CCW, 0.5)
    error = InstrumentError(
        "the line was closed while it was in use",
        where="/dev/ttyUSB0",
        remedy="plug the instrument in again, then look with `dbbstation instrument ports` whether its port is still called so",
    )
    happening.events += happening.sequencer.fail(error)
    return happening


STATES = [set_up, second_circle, verdict, findings, fault]


def drawn(svg: str) -> tuple[str, str]:
    """The rows of text, and the text with its colours: what rows alone would not show.

    Names that are made from a hash of the content, places in points and the order of the style sheet are left out.
    """
    styles = {
        name: ";".join(sorted(part.strip() for part in style.split(";") if part.strip()))
        for name, style in re.findall(r"\.terminal-\d+-(r\d+) \{([^}]*)\}", svg)
    }
    rows: dict[float, list[tuple[float, str, str]]] = {}
    for name, x, y, text in re.findall(
        r'<text class="terminal-\d+-(r\d+)" x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]*)</text>', svg
    ):
        rows.setdefault(float(y), []).append((float(x), html.unescape(text).replace("\xa0", " "), styles[name]))
    plain, coloured = [], []
    for y in sorted(rows):
        line = ""
        for x, text, style in sorted(rows[y]):
            if text.strip():
                line = line.ljust(round(x / 12.2)) + text.rstrip("\n")
                coloured.append(f"{round(x / 12.2):3} {style}: {text.strip()}")
        plain.append(line.rstrip())
    return "\n".join(plain) + "\n", "\n".join(coloured) + "\n"


@pytest.mark.parametrize("size", [(80, 24), (120, 40)], ids=["80x24", "120x40"])
@pytest.mark.parametrize("state", STATES, ids=lambda state: state.__name__)
def test_the_screen_looks_as_it_did(state: Callable[[], Happening], size: tuple[int, int]) -> None:
    happening = state()
    text, _ = drawn(asyncio.run(still_svg(happening.shown(), happening.events, size=size)))
    kept = KEPT / f"{state.__name__}-{size[0]}x{size[1]}.txt"
    if KEEP:
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(text, encoding="utf-8")
    assert text.splitlines() == kept.read_text(encoding="utf-8").splitlines()


OTHERS = {"overview": ("o",), "help": ("f1",), "large": ("f",), "reason": ("o", "left", "x")}
"""Keys that lead to further screens, from a session with a circle accepted."""


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 60)], ids=["80x24", "120x40", "200x60"])
@pytest.mark.parametrize("screen", OTHERS)
def test_other_screens_look_as_they_did(screen: str, size: tuple[int, int]) -> None:
    happening = Happening().circle("t0", Direction.CCW).command(Accept())
    pressed = asyncio.run(still_svg(happening.shown(), happening.events, size=size, press=OTHERS[screen]))
    text, _ = drawn(pressed)
    kept = KEPT / f"{screen}-{size[0]}x{size[1]}.txt"
    if KEEP:
        kept.write_text(text, encoding="utf-8")
    assert text.splitlines() == kept.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("theme", [DARK, LIGHT])
def test_the_colours_are_as_they_were(theme: str) -> None:
    happening = second_circle()
    _, colours = drawn(asyncio.run(still_svg(happening.shown(), happening.events, size=(80, 24), theme=theme)))
    kept = KEPT / f"colours-{theme}.txt"
    if KEEP:
        kept.write_text(colours, encoding="utf-8")
    assert colours.splitlines() == kept.read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("state", STATES, ids=lambda state: state.__name__)
def test_without_colours_every_word_is_there(state: Callable[[], Happening], monkeypatch: pytest.MonkeyPatch) -> None:
    happening = state()
    coloured, _ = drawn(asyncio.run(still_svg(happening.shown(), list(happening.events), size=(80, 24))))
    monkeypatch.setenv("NO_COLOR", "1")
    plain, styles = drawn(asyncio.run(still_svg(happening.shown(), list(happening.events), size=(80, 24))))
    assert plain == coloured
    hues = set(re.findall(r"fill: #(\w{6})", styles))
    assert hues
    assert all(colour[:2] == colour[2:4] == colour[4:] for colour in hues)


def test_what_is_wrong_stands_first_with_number_limit_and_word() -> None:
    happening = findings()
    text, _ = drawn(asyncio.run(still_svg(happening.shown(), happening.events, size=(80, 24))))
    rows = [" ".join(row.split()) for row in text.splitlines()]
    (wrong,) = (k for k, row in enumerate(rows) if row.endswith("closure 4.10 of 1.95 µm wrong"))
    assert rows[wrong + 1].endswith("repeat cannot tell")
    assert rows[wrong + 2].endswith("noise 0.31 of 0.61 µm good")


def test_a_still_is_the_same_each_time() -> None:
    happening = verdict()
    one, other = (asyncio.run(still_svg(happening.shown(), list(happening.events))) for _ in range(2))
    assert drawn(one) == drawn(other)


@pytest.mark.parametrize("size", [(20, 8), (60, 18), (200, 60), (80, 10)])
def test_any_size_is_drawn(size: tuple[int, int]) -> None:
    happening = second_circle()
    text, _ = drawn(asyncio.run(still_svg(happening.shown(), happening.events, size=size)))
    # Where there is no room for all of the title, the plan's name gives way to run and state.
    assert "t0-cw-1" in text.splitlines()[0]


def test_light_is_light_and_dark_is_dark() -> None:
    happening = set_up()
    dark, light = (asyncio.run(still_svg(happening.shown(), happening.events, theme=theme)) for theme in (DARK, LIGHT))
    assert drawn(dark)[0] == drawn(light)[0]
    assert "#121212" in dark
    assert "#121212" not in light


def test_fifteen_tests_stand_on_the_map_with_word_and_figure() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    happening = Happening(plan)
    happening.circle("a", Direction.CCW).command(Accept())
    shown = replace(happening.shown(), bores={test.ball.bore: test.ball.centre_mm[:2] for test in plan.tests.values()})
    text, _ = drawn(asyncio.run(still_svg(shown, happening.events, size=(120, 40), press=("o",))))
    on_map = "\n".join(row[:72] for row in text.splitlines())
    assert on_map.count("ccw ·") == 14
    assert on_map.count("cw  · open") == 14
    assert re.search(r"a ccw ✓ accepted +24\.0", on_map)
    assert re.search(r"cw +› next", on_map)
    assert all(re.search(rf"\b{name} ccw", on_map) for name in plan.tests)
