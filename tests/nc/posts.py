"""Programs of our own writing in the habits of twenty-three posts: how they begin, change tools, write arcs and holes, and end."""

from __future__ import annotations

import math
import random
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Post:
    """Habits of a post; `{t}`, `{s}`, `{x}`, `{y}` and `{name}` stand for tool, spindle, first place and title."""

    name: str
    begin: str
    tool: str
    end: str
    decimals: int = 3
    zeros: bool = True
    numbers: int = 0
    spaces: bool = True
    radius: bool = False
    modal: bool = True
    cycles: bool = True
    planes: bool = True
    inches: bool = False
    percent: bool = True
    subprograms: bool = False
    goes_on: bool = False
    """Moves behind G80 have no G0."""


POSTS = (
    Post(
        "fusion",
        "(1001)\n(T1 D=6. CR=0. - ZMIN=-4. - flat end mill)\nG90 G94 G17 G91.1\nG21\n(When using Fusion for Personal Use, rapids are slow)\nG53 G0 Z-940.",
        "(Contour)\nM9\nT{t} M6\nS{s} M3\nG54\nM8\nG0 X{x} Y{y}\nG43 Z15. H{t}",
        "M9\nM5\nG53 G0 Z-940.\nG53 G0 X0. Y0.\nM30",
        zeros=False,
        radius=False,
        goes_on=True,
    ),
    Post(
        "mastercam",
        "O0000({name})\n(DATE=DD-MM-YY - 01-02-25 TIME=HH:MM - 10:11)\n(MATERIAL - ALUMINUM MM - 2024)\n( T{t} | 6. FLAT ENDMILL | H1 )\nG21\nG0 G17 G40 G49 G80 G90",
        "T{t} M6\nG0 G90 G54 X{x} Y{y} S{s} M3\nG43 H{t} Z25.\nZ2.",
        "M5\nG91 G28 Z0.\nG28 X0. Y0.\nG90\nM30",
        zeros=False,
        numbers=2,
        radius=True,
    ),
    Post(
        "freecad",
        "(Exported by FreeCAD)\n(Post Processor: linuxcnc_post)\n(begin preamble)\nG17 G54 G40 G49 G80 G90\nG21",
        "(begin operation: {name})\n(Machine units: mm/min)\nM5\nM6 T{t}\nG43 H{t}\nM3 S{s}\nG0 Z15.000\nG0 X{x} Y{y}",
        "(begin postamble)\nM05\nG17 G54 G90 G80 G40\nM2",
        modal=False,
        percent=False,
    ),
    Post(
        "fanuc",
        "O1234\nG21\nG17 G40 G80 G49\nG91 G28 Z0.",
        "T{t} M06\nG90 G00 G54 X{x} Y{y}\nS{s} M03\nG43 H{t} Z50. M08",
        "M09\nG91 G28 Z0. M05\nM01\nM30",
        zeros=False,
        numbers=10,
        spaces=False,
        radius=True,
    ),
    Post(
        "haas",
        "O00010 ({name})\n(Using high feed G1 F5000. instead of G0.)\nG90 G94 G17\nG21\nG53 G00 Z-940.",
        "T{t} M06\nS{s} M03\nG54\nG00 X{x} Y{y}\nG43 Z15. H{t}\nM08",
        "M05\nM09\nG53 G00 Z-940.\nG53 G00 Y0.\nM30",
        zeros=False,
        decimals=4,
        numbers=5,
        goes_on=True,
        inches=True,
    ),
    Post(
        "siemens-iso",
        "; {name}\nG17 G21 G40 G90 G94\nG54 G64",
        "T{t} M6\nG0 G90 X{x} Y{y} S{s} M3\nG43 H{t} Z30. M8",
        "M9\nM5\nG0 Z40.\nM30",
        zeros=False,
        decimals=4,
        numbers=1,
        percent=False,
    ),
    Post(
        "mach3",
        "({name})\n(Mach2/3 Postprocessor)\nG00 G20 G17 G90 G40 G49 G80\nG21\nG64 P0.05\nG61",
        "M6T{t}\nG43 H{t}\nM03 S{s}\nG54\nG00 Z20.0000\nG0 X{x} Y{y}",
        "M09\nM05\nG00 Z30.0000\nM30",
        decimals=4,
        numbers=10,
        spaces=False,
    ),
    Post(
        "grbl",
        "; {name}\n; Generated for a small router\nG21 G90 G94\nG54",
        "M3 S{s}\nG0 Z10.000\nG0 X{x} Y{y}",
        "G0 Z10.000\nM5\nG0 X0.000 Y0.000\nM2",
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "linuxcnc",
        "({name})\nG17 G21 G40 G49 G64 P0.01 G80 G90 G91.1 G92.1 G94 G97 G98\n#<safe>=20.0\n#<feed>=400",
        "T{t} M6 G43\nG97 S{s} M3\nG54 G0 Z#<safe>\nG0 X{x} Y{y}",
        "G0 Z#<safe>\nM5 M9\nM2",
        percent=False,
    ),
    Post(
        "fanuc-subprograms",
        "O2000({name})\nG21\nG17 G40 G49 G80 G90\nG91 G28 Z0.",
        "T{t} M6\nG90 G0 G54 X{x} Y{y} S{s} M3\nG43 H{t} Z30. M8",
        "M9\nG91 G28 Z0. M5\nG90\nM30",
        zeros=False,
        radius=True,
        subprograms=True,
    ),
    Post(
        "estlcam",
        "(Project {name})\n(Created by Estlcam)\n(Required tools:)\n(Fräser 3mm)\nG21\nG90\nG94",
        "M03 S{s}\nG00 Z15.0000\n(No. {t}: contour)\nG00 X{x} Y{y}",
        "G00 Z15.0000\nM05\nM30",
        decimals=4,
        modal=False,
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "vectric",
        "( {name} )\n( Material size )\nG17\nG21\nG90\nG0Z20.320\nG0X0.000Y0.000",
        "T{t}M6\nS{s}M3\nG0Z20.320\nG0X{x}Y{y}",
        "G0Z20.320\nG0X0.000Y0.000\nM9\nM30",
        spaces=False,
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "solidcam",
        "O1000 (PART.TAP)\n(SUBROUTINES: O2 .. O0)\n(COMPENSATION-WEAR)\nG21\nG90 G17\nG80 G49 G40\nG54\nG91 G28 Z0\nG90\nM01",
        "(---------------------)\n({name} - PROFILE)\nM6 T{t}\n(TOOL -{t}- MILL DIA 6.0 R0. MM )\nG90 G00 G40 G54\nG43 H{t} D3{t} G0 X{x} Y{y} Z50. S{s} M3\nM8",
        "M5\nM9\nG91 G28 Z0\nG90\nM30",
        zeros=False,
        radius=True,
    ),
    Post(
        "hsmworks",
        "O01001 ({name})\n(T{t} D=6. CR=0. - ZMIN=-6. - flat end mill)\nG90 G94 G17 G49 G40 G80\nG21\nG28 G91 Z0.\nG90",
        "(2D Adaptive)\nT{t} M6\nG187 P1\nS{s} M3\nG17 G90 G94\nG54\nM8\nG0 X{x} Y{y}\nG43 Z15. H{t}\nT1",
        "M9\nG28 G91 Z0.\nG90\nG49\nG187\nM5\nM30",
        zeros=False,
        numbers=5,
        goes_on=True,
    ),
    Post(
        "hand-fanuc",
        "O0100 (HAND)\nG90 G80 G40 G49 G50 G21 G17",
        "T0{t} M06\nG05.1 Q1\nG54 G00 X{x} Y{y} S{s} M03\nG43 H0{t} Z50 M08",
        "G05.1 Q0\nG80 G00 Z100. M09\nG91 G28 Z0. M05\nG90\nM30",
        zeros=False,
        numbers=1,
        spaces=False,
        radius=True,
    ),
    Post(
        "bcnc",
        "(Block-name: Header)\n(Units: mm)\nG17 G90 G21\nG54",
        "(Block-name: {name} [cut,tool{t}])\nM3 S{s}\nG4 P3\nG0 Z15\nG0 X{x} Y{y}",
        "(Block-name: Footer)\nG0 Z15\nM5",
        decimals=4,
        zeros=False,
        cycles=False,
        percent=False,
    ),
    Post(
        "fusion-grbl",
        "(1001)\n(T1 D=1.4 CR=0 - ZMIN=-3 - flat end mill)\nG90 G94\nG17\nG21",
        "(2D Contour{t})\nT{t}\nS{s} M3\nG54\nG0 X{x} Y{y}\nZ15\nG1 Z5 F1000",
        "G0 Z15\nM5\nM30",
        zeros=False,
        cycles=False,
        percent=False,
    ),
    Post(
        "gcodetools",
        "(Header)\nM3\n(Header end.)\nG21 (All units in mm)",
        "(Start cutting path id: path{t})\n(Change tool to Default tool)\nG00 Z15.000000\nG00 X{x} Y{y}",
        "(End cutting path id: path1)\nG00 Z15.000000\n(Footer)\nM5\nG00 X0.0000 Y0.0000\nM2\n(Using default footer.)",
        decimals=6,
        modal=False,
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "pcb2gcode",
        "( pcb2gcode 2.5.0 )\nG94 ( Millimeters per minute. )\nG21 ( Units. )\nG90\nG00 S10000 ( RPM. )\nG64 P0.01016\nG01 F200.00000 ( Feedrate. )",
        "G00 Z15.00000 (Retract)\nT{t}\nM5      (Spindle stop.)\nG04 P1.00000\n(MSG, Change tool bit to cutter {t})\nM6\nM0\n"
        "M3 ( Spindle on. )\nG04 P0 ( no time )\nG00 Z15.00000\nG0 X{x} Y{y}",
        "G00 Z15.000 ( retract )\nM5\nG04 P1.000000\nM9\nM2",
        decimals=5,
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "grblgru",
        "( Created by GrblGru )\nG21\nG1 F200 Z25\nG4 P2\nG90 F100",
        "( Spindle on )\nM3\nS{s}\nF2000 G90 G1 Z15.000\nX{x} Y{y}",
        "F2000 Z15.000\nM5\nG1 F2000 X0.000 Y0.000",
        cycles=False,
        planes=False,
        percent=False,
    ),
    Post(
        "cambam",
        "( Made using CamBam )\n( {name} )\n( T1 : 3.0 )\nG21 G90 G64 G40\nG0 Z15.0",
        "( T{t} : 3.0 )\nT{t} M6\n( Profile1 )\nG17\nM3 S{s}\nG0 X{x} Y{y}",
        "G0 Z15.0\nM5\nM30",
        decimals=4,
        zeros=False,
        modal=False,
        percent=False,
    ),
    Post(
        "freecad-grbl",
        "(Exported by FreeCAD)\n(Post Processor: grbl_post)\n(Begin preamble)\nG17 G90\nG21\n(Begin operation: G54)\nG54",
        "(Begin toolchange)\n( M6 T{t} )\nM3 S{s}\n(Begin operation: {name})\nG0 Z15.000\nG0 X{x} Y{y}",
        "(Begin postamble)\nM5\nG17 G90\nM2",
        modal=False,
        cycles=False,
        percent=False,
    ),
    Post(
        "hand-linuxcnc",
        "#<_safe> = 20.0 ; above clamps\nG21 G90 G17\nF600",
        "G10 L1 P{t} Z-3.5 R3.0 ; set tool\nT{t}\nM06\nG43 H{t}\nM3 S{s}\nG54\nG0 Z#<_safe>\nG0 X{x} Y{y}",
        "G0 Z#<_safe>\nM5\nM2 ; end program",
        percent=False,
    ),
)


def program(post: Post, seed: int) -> str:
    """One part: contours with arcs, helices, holes, arcs in other planes, two tools."""
    return _Author(post, random.Random(f"{post.name} {seed}")).program()  # noqa: S311 - the same programs each time


class _Author:
    def __init__(self, post: Post, draw: random.Random) -> None:
        self.post, self.draw = post, draw
        self.lines: list[str] = []
        self.unit = 25.4 if post.inches else 1.0
        self.last = ""
        self.called: list[list[str]] = []

    def program(self) -> str:
        draw, post = self.draw, self.post
        self.say(post.begin.replace("G21", "G20" if post.inches else "G21"))
        for tool in range(1, draw.choice([2, 3])):
            x, y = (round(draw.uniform(-30, 30), 1) for _ in range(2))
            self.say(post.tool, tool=tool, x=x, y=y)
            for part in draw.sample([self.contour, self.pocket, self.helix, self.holes, self.entry, self.peck], 3):
                before = len(self.lines)
                part(x, y)
                if post.subprograms:
                    self.called.append([f"O{7001 + len(self.called)}", *self.lines[before:], "M99"])
                    self.lines[before:] = [f"M98 P{7000 + len(self.called)}"]
                    self.last = ""
        self.say(post.end)
        lines = self.lines + [line for lines in self.called for line in lines]
        if post.numbers:
            numbered = (line and line[0] not in "O(;" for line in lines)
            lines = [
                f"N{post.numbers * k}{' ' if post.spaces else ''}{line}" if one else line
                for k, (line, one) in enumerate(zip(lines, numbered, strict=True), 1)
            ]
        lines = ["%", *lines, "%"] if post.percent else lines
        return "\n".join(lines) + "\n"

    def say(self, template: str, tool: int = 1, x: float = 0.0, y: float = 0.0) -> None:
        said = template.format(t=tool, s=6000, x=self.number(x), y=self.number(y), name="PART 7")
        if self.post.inches:
            said = re.sub(r"\bZ(-?\d+)\.", lambda at: f"Z{self.number(float(at[1]))}", said)
        self.lines += said.splitlines()
        self.last = ""

    def number(self, value: float) -> str:
        text = f"{value / self.unit:.{self.post.decimals}f}"
        if self.post.zeros:
            return text
        text = text.rstrip("0")
        return text.replace("-0.", "-.").removeprefix("0") if text[:2] == "0." and len(text) > 2 else text

    def go(self, code: str, **words: float) -> None:
        """One move; the code only where it changes, for posts that leave it out."""
        told = [] if self.post.modal and code == self.last else [code]
        self.last = code if code in {"G0", "G1"} else ""
        for letter, value in words.items():
            told.append(
                f"F{value / self.unit:.{1 if self.unit > 1.0 else 0}f}"
                if letter == "F"
                else f"{letter}{self.number(value)}"
            )
        self.lines.append((" " if self.post.spaces else "").join(told))

    def down(self, depth: float) -> None:
        self.go("G0", Z=2.0)
        self.go("G1", Z=depth, F=200.0)

    def up(self) -> None:
        self.go("G0", Z=15.0)

    def arc(self, code: str, x: float, y: float, i: float, j: float, **more: float) -> None:
        if self.post.radius and self.draw.random() < 0.7:
            self.go(code, X=x, Y=y, R=round(math.hypot(i, j), 3), **more)
        else:
            self.go(code, X=x, Y=y, I=i, J=j, **more)

    def contour(self, x: float, y: float) -> None:
        """A rectangle with round corners."""
        wide, high, radius = 12.0, 8.0, 2.0
        self.go("G0", X=x + radius, Y=y)
        self.down(-1.0)
        self.go("G1", X=x + wide - radius, F=600.0)
        self.arc("G3", x + wide, y + radius, 0.0, radius)
        self.go("G1", Y=y + high - radius)
        self.arc("G3", x + wide - radius, y + high, -radius, 0.0)
        self.go("G1", X=x + radius)
        self.arc("G3", x, y + high - radius, 0.0, -radius)
        self.go("G1", Y=y + radius)
        self.arc("G3", x + radius, y, radius, 0.0)
        self.up()

    def pocket(self, x: float, y: float) -> None:
        self.go("G0", X=x, Y=y)
        self.down(-0.5)
        for turn in range(1, 4):
            self.go("G1", X=x + turn, Y=y + turn, F=800.0)
            self.go("G1", X=x - turn)
            self.go("G1", Y=y - turn)
            self.go("G1", X=x + turn)
            self.go("G1", Y=y + turn)
        self.up()

    def helix(self, x: float, y: float) -> None:
        self.go("G0", X=x + 4.0, Y=y)
        self.down(0.0)
        for depth in (-1.0, -2.0):
            self.go("G2", X=x + 4.0, Y=y, Z=depth, I=-4.0, J=0.0, **({"F": 300.0} if depth == -1.0 else {}))
        self.go("G2", X=x + 4.0, Y=y, I=-4.0, J=0.0)
        self.up()

    def holes(self, x: float, y: float) -> None:
        if not self.post.cycles:
            for place in range(3):
                self.go("G0", X=x + 6.0 * place, Y=y)
                self.down(-3.0)
                self.up()
            return
        self.go("G0", X=x, Y=y)
        self.lines.append(
            f"G98 G81 X{self.number(x)} Y{self.number(y)} Z{self.number(-3.0)} R{self.number(2.0)} F{self.number(120.0)}"
        )
        self.lines += [f"X{self.number(x + 6.0 * place)}" for place in (1, 2)]
        self.lines += ["G80"]
        self.last = "G0" if self.post.goes_on else ""

    def peck(self, x: float, y: float) -> None:
        if not self.post.cycles:
            return self.helix(x, y)
        code = self.draw.choice(["G83", "G73"])
        self.go("G0", X=x, Y=y)
        self.lines.append(
            f"G99 {code} X{self.number(x)} Y{self.number(y)} Z{self.number(-6.0)} R{self.number(1.5)} Q{self.number(2.5)} F{self.number(120.0)}"
        )
        self.lines += [f"Y{self.number(y + 5.0)}", "G80"]
        self.last = "G0" if self.post.goes_on else ""
        return self.up()

    def entry(self, x: float, y: float) -> None:
        """Down and up again on quarters of circles in another plane."""
        if not self.post.planes:
            return self.pocket(x, y)
        self.go("G0", X=x, Y=y)
        self.go("G0", Z=1.0)
        self.go("G1", Z=0.5, F=300.0)
        self.lines.append("G18")
        self.go("G3", X=x + 1.5, Z=-1.0, I=1.5, K=0.0)
        self.lines.append("G17")
        self.last = ""
        self.go("G1", X=x + 8.0, F=500.0)
        self.lines.append("G19")
        self.go("G2", Y=y + 1.5, Z=0.5, J=0.0, K=1.5)
        self.lines.append("G17")
        self.last = ""
        return self.up()
