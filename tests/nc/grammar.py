"""Programs drawn from a grammar: mostly as people and CAM systems write them, with what they get wrong among it."""

from __future__ import annotations

import random


def program(seed: int) -> str:
    return _Author(random.Random(seed)).program()  # noqa: S311 - the same programs each time, nothing secret


def part(seed: int) -> str:
    """One program that the reference machine can run, with all that a program may say; the same seed gives the same text."""
    return _Machinist(random.Random(seed)).program()  # noqa: S311 - the same programs each time, nothing secret


class _Author:
    def __init__(self, draw: random.Random) -> None:
        self.draw = draw

    def program(self) -> str:
        draw = self.draw
        lines = ["%"] if draw.random() < 0.15 else []
        lines.append(
            draw.choice(["G21 G90 G94", "G21 G90 G94 G17 G40 G49 G64", "g90g21", "(part) G21 G90", "G20 G90", "G90"])
        )
        if draw.random() < 0.3:
            lines.append(
                draw.choice(["G61", "G64", "G64 P0.01", "G64 P0.01 Q0", "S1200 M3", "F100", "G91.1", "G54", "G55"])
            )
        lines.append(
            draw.choice(["G0 X0 Y0 Z-1000 A0 B0 C0", "G0 X1.5 Y-2 Z-40 A0 B0 C0", "G1 X0 Y0 Z-1000 A1 B2 C0 F500"])
        )
        lines += [self.block() for _ in range(draw.randint(2, 10))]
        end = draw.random()
        if lines[0] == "%" and end < 0.8:
            lines += ["M2", "%"] if end < 0.3 else ["%"]
        elif end < 0.93:
            lines.append(draw.choice(["M2", "M30", "m2", "G0 Z-20 M30", "M5 M9 M2", "M02", "M 3 0"]))
        newline = "\r\n" if draw.random() < 0.1 else "\n"
        return newline.join(lines) + (newline if draw.random() < 0.8 else "")

    def block(self) -> str:
        kinds = {
            self.move: 10,
            self.modal: 5,
            self.arc: 6,
            self.dwell: 2,
            self.mode: 3,
            self.stop: 1,
            self.spindle: 1,
            self.comment: 1,
            self.odd: 0.25,
        }
        text = self.draw.choices(list(kinds), list(kinds.values()))[0]()
        return self.dressed(text)

    def dressed(self, text: str) -> str:
        draw = self.draw
        if draw.random() < 0.1:
            text = text.lower()
        if draw.random() < 0.1:
            text = text.replace(" ", "")
        if draw.random() < 0.05:
            text = " " + text.replace(" ", "\t", 1)
        if draw.random() < 0.15:
            text = f"N{draw.randint(0, 999)} {text}"
        if draw.random() < 0.1:
            text += draw.choice([" (note)", " ; note", ";", " ()"])
        if draw.random() < 0.1:
            words = text.split(" ")
            draw.shuffle(words)
            text = " ".join(words)
        return text

    def number(self, size: float) -> str:
        draw = self.draw
        value = draw.uniform(-size, size)
        return draw.choice(
            [f"{value:.3f}", f"{value:.0f}", f"{value:.1f}", f"{value:+.2f}", f"{value:.4f}".replace("0.", "."), "0"]
        )

    def axes(self, letters: str, size: float) -> str:
        return " ".join(f"{letter}{self.number(size)}" for letter in letters)

    def some(self, letters: str) -> str:
        return "".join(
            sorted(self.draw.sample(letters, self.draw.randint(1, min(3, len(letters)))), key="XYZABC".index)
        )

    def feed(self) -> str:
        return self.draw.choice(["", "", f" F{self.draw.randint(1, 5000)}", f" F{self.draw.uniform(0.5, 900):.2f}"])

    def move(self) -> str:
        draw = self.draw
        target = self.axes(self.some("XYZ"), 50) if draw.random() < 0.7 else ""
        turn = self.axes(self.some("ABC"), 15) if draw.random() < 0.4 else ""
        words = " ".join(part for part in (target, turn) if part) or "X1"
        if draw.random() < 0.05:
            words = f"{draw.choice(['@', '^', '^', '@5 ^'])}{self.number(30)} {turn}".rstrip()
        return f"{draw.choice(['G0', 'G1', 'G1', 'G01', 'G00'])} {words}{self.feed()}"

    def modal(self) -> str:
        return self.axes(self.some("XYZABC"), 30) + self.feed()

    def arc(self) -> str:
        draw = self.draw
        code = draw.choice(["G2", "G3", "G03"])
        feed = f" F{draw.randint(50, 3000)}"
        form = draw.random()
        if form < 0.35:
            words = f"I{self.number(20)} J{draw.uniform(1, 20):.3f}"
        elif form < 0.65:
            words = f"{self.axes('XY', 10)} R{draw.choice(['', '', '-'])}{draw.uniform(70, 200):.2f}"
        elif form < 0.93:
            # Only an increment leads to a point on the circle whatever came before it: half a turn.
            half = draw.uniform(0.5, 20)
            words = f"G91 X{2 * half:.3f} I{half:.4f}"
        else:
            words = draw.choice(WRONG_ARCS)
        if draw.random() < 0.2:
            words += f" Z{self.number(10)}" if "Z" not in words else ""
        if draw.random() < 0.15:
            words += f" P{draw.choice(['1', '2', '2', '3', '3', '0', '1.5'])}"
        return f"{code} {words}{feed}"

    def dwell(self) -> str:
        return self.draw.choice(DWELLS * 10 + WRONG_DWELLS)

    def mode(self) -> str:
        return self.draw.choice(MODES * 8 + WRONG_MODES)

    def stop(self) -> str:
        return self.draw.choice(["M0", "M1", "M0 (MSG, look)", "(MSG, look)", "G0 X3 M0", "M00", "M0 M1"])

    def spindle(self) -> str:
        return self.draw.choice(SPINDLE * 15 + WRONG_SPINDLE)

    def comment(self) -> str:
        return self.draw.choice(COMMENTS * 15 + WRONG_COMMENTS)

    def odd(self) -> str:
        return self.draw.choice(ODD)


class _Machinist(_Author):
    """Keeps count of units, distances and the pose, so that no move leaves the travel and no arc its circle."""

    def __init__(self, draw: random.Random) -> None:
        super().__init__(draw)
        self.pose = [0.0, 0.0, -1000.0, 0.0, 0.0, 0.0]
        self.unit_mm, self.absolute, self.has_feed = 1.0, True, False

    def program(self) -> str:
        draw = self.draw
        percent = draw.random() < 0.2
        lines = ["%"] if percent else []
        lines.append(draw.choice(["G21 G90 G94", "G21 G90 G94 G17 G40 G49", "g90g21", "(part) G21 G90"]))
        lines += [draw.choice([*PATHS, *WORK_SYSTEMS, *SPEEDS, *SAID]) for _ in range(draw.randint(0, 3))]
        lines.append("G0 X0 Y0 Z-1000 A0 B0 C0")
        for _ in range(draw.randint(3, 12)):
            lines += self.blocks()
        lines += (
            ["%"]
            if percent and draw.random() < 0.5
            else [draw.choice(["M2", "M30", "M5 M9 M2", "M02"]), *lines[:percent]]
        )
        return "\n".join(lines) + "\n"

    def blocks(self) -> list[str]:
        draw, kind = self.draw, self.draw.random()
        if kind < 0.4:
            return [self.dressed(self.straight())]
        if kind < 0.55:
            return [self.dressed(self.round())]
        if kind < 0.62:
            self.unit_mm = draw.choice([1.0, 1.0, 25.4])
            self.has_feed = False
            return [("G21" if self.unit_mm == 1.0 else "G20") + " G94"]
        if kind < 0.67:
            self.absolute = draw.random() < 0.6
            return ["G90" if self.absolute else "G91"]
        if kind < 0.72:
            return self.in_machine()
        return [self.dressed(draw.choice([*PATHS, *WORK_SYSTEMS, *SPEEDS, *SAID, *STOPS, *DWELLS[:3]]))]

    def dressed(self, text: str) -> str:
        """As somebody else would write it; comments and messages stay in one piece, and N stands first."""
        draw = self.draw
        if "(" in text or ";" in text:
            return text
        words = text.split(" ")
        if draw.random() < 0.1:
            draw.shuffle(words)
        text = draw.choice([" ", " ", " ", "", "\t"]).join(words)
        text = text.lower() if draw.random() < 0.1 else text
        text = f"N{draw.randint(0, 999)} {text}" if draw.random() < 0.15 else text
        return text + (draw.choice([" (note)", " ; note", ";", " ()"]) if draw.random() < 0.1 else "")

    def words(self, axes: list[int]) -> str:
        """Words that lead some axes to places within the travel, in the units and distances that hold."""
        words = []
        for axis in axes:
            low, high = BOX[axis]
            unit = self.unit_mm if axis < 3 else 1.0
            base = 0.0 if self.absolute else self.pose[axis]
            written = round((self.draw.uniform(low, high) - base) / unit, 3 if unit == 1.0 else 4)
            self.pose[axis] = base + written * unit
            words.append(f"{'XYZABC'[axis]}{written:.{self.draw.choice([4, 5])}f}")
        return " ".join(words)

    def speed(self) -> str:
        if self.has_feed and self.draw.random() < 0.6:
            return ""
        self.has_feed = True
        # So slow that short pieces with A, B and C keep it on a control that does not look ahead there.
        return f" F{self.draw.uniform(5, 40) / self.unit_mm:.3f}"

    def straight(self) -> str:
        draw = self.draw
        tip, turn = (
            sorted(draw.sample(range(3), draw.randint(1, 3))),
            sorted(draw.sample(range(3, 6), draw.randint(1, 3))),
        )
        axes = draw.choice([tip, tip, tip + turn, turn])
        if draw.random() < 0.3:
            return f"G0 {self.words(axes)}"
        return f"G1 {self.words(axes)}{self.speed()}"

    def round(self) -> str:
        draw = self.draw
        radius = round(draw.uniform(0.3, 4.0) / self.unit_mm, 4)
        code, turns = draw.choice(["G2", "G3"]), draw.choice(["", "", "", " P1", " P2"])
        if draw.random() < 0.5:
            x, y = draw.choice([(radius, 0.0), (0.0, -radius), (radius, radius)])
            rise = f" {self.words([2])}" if draw.random() < 0.4 else ""
            return f"{code} I{x:.4f} J{y:.4f}{rise}{turns}{self.speed()}"
        x = self.pose[0] / self.unit_mm if self.absolute else 0.0
        end = round(x + radius, 4)
        self.pose[0] = end * self.unit_mm if self.absolute else self.pose[0] + end * self.unit_mm
        sign = draw.choice(["", "-"])
        return f"{code} X{end:.4f} R{sign}{radius * draw.uniform(0.55, 1.5):.4f}{self.speed()}"

    def in_machine(self) -> list[str]:
        """As programs have it: up in machine coordinates, over there, down again; sometimes less tidy."""
        draw = self.draw
        before = [] if self.absolute else ["G90"]
        self.absolute = True
        kind = draw.random()
        if kind < 0.6:
            up = f"G53 G0 {self.words([2])}"
            return [*before, up, f"G0 {self.words([0, 1, 3, 4, 5])}", f"G0 {self.words([2])}"]
        if kind < 0.8:
            return [
                *before,
                f"G53 G1 {self.words([0, 1, 2, 3, 4, 5])}{self.speed()}",
                f"G0 {self.words([0, 1, 2, 3, 4, 5])}",
            ]
        return [*before, f"G53 G1 {self.words([draw.randrange(3)])}{self.speed()}"]


BOX = [(-60.0, 60.0), (-60.0, 60.0), (-1040.0, -960.0), (-5.0, 5.0), (-5.0, 5.0), (-4.5, 4.5)]
PATHS = ["G61", "G64", "G64 P0.01", "G64 P0.02 Q0"]
WORK_SYSTEMS = ["G54", "G55", "G54 (left vice)"]
SPEEDS = ["S0.00001 M3", "S0.5", "S1200 M4", "M3 S800", "M5", "M7", "M8", "M9", "S12345.678 M3"]
SAID = [
    "(MSG, look)",
    "(DEBUG, system #5220)",
    "(PRINT, line)",
    "(LOG, begun)",
    "(msg,small) ; after",
    "(one) (MSG, last)",
]
SAID += [
    "(MSG, first) (only a comment)",
    "; (MSG, no message)",
    "(a comment)",
    "( MSG , not one either)",
    "(LOGOPEN, part.log)",
]
STOPS = ["M0", "M1", "M0 (MSG, look)", "M01", "(MSG, turn the part)\nM0"]

WRONG_ARCS = ["X5", "I5", "X5 Y5 I5", "R5", "X4 R2", "Z3 I2 J2", "A5 I4", "X3 I0.001", "X10 I4 R3", ""]
DWELLS = ["G4 P0.5", "G4 P0", "G04 P2", "G4 P1 X5", "G4 P1 G1 X2 F100"]
WRONG_DWELLS = ["G4", "G4 P-1", "G4 P1 G2 X2 I1 F100"]
MODES = [
    "G90",
    "G90",
    "G91",
    "G20",
    "G21",
    "G90.1",
    "G91.1",
    "G17",
    "G94",
    "G40",
    "G49",
    "G54",
    "F250",
    "G64",
    "G90 G0 X1",
]
MODES += ["G91 G1 Y1 F100", "G90 G53 G0 X1", "G90 G53 G1 Z-30 F80", "G90 G0 G53 X2", "G0", "G1"]
WRONG_MODES = ["G80", "G53", "G53 G2 X5 R5 F50", "G2", "G20 F10", "G61", "G53 X2", "G91 G53 X2"]
SPINDLE = ["M3 S800", "S500", "M5", "M7", "M8 M3", "M9", "M4 S0"]
WRONG_SPINDLE = ["S-5", "M3 M5", "M8 M9"]
COMMENTS = ["", "(a comment)", "; X5 G1", "(one) (two)", "(a ; b)", "; (open"]
WRONG_COMMENTS = ["(unclosed", "(a (b))", "/", "a)"]
ODD = [
    "X",
    "G",
    "%",
    "G1 X1 X2 F100",
    "G1 Y2 F0",
    "F-10",
    "G41 D1",
    "G18",
    "T1 M6",
    "X#5",
    "G1 X[1+2] F9",
    "O100 sub",
    "E5",
]
ODD += ["P2", "I3", "R4", "G0 G1 X1", "G90 G91", "X1 N5", "G0 X1e2", "G0 X1.2.3", "G0 X--1", "@1", "G5 X1", "K3", "U5"]
ODD += [
    "G64 P0.1 G3 I5 F100",
    "G80 X5",
    "G0 X5 G80",
    "X5 R2",
    "G0 X" + "0" * 300 + "1",
    "N5",
    "G28",
    "G93",
    "M48",
    "N5. X1",
]
