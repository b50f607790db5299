"""Programs drawn from a grammar: mostly as people and CAM systems write them, with what they get wrong among it."""

from __future__ import annotations

import random


def program(seed: int) -> str:
    """One program; the same seed gives the same text."""
    return _Author(random.Random(seed)).program()  # noqa: S311 - the same programs each time, nothing secret


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
            lines.append(draw.choice(["G61", "G64", "G64 P0.01", "G64 P0.01 Q0", "S1200 M3", "F100", "G91.1", "G54"]))
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
        """Write the same words as somebody else would."""
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
