"""A new dialect is one new file."""

from __future__ import annotations

import importlib.metadata
import re
import textwrap
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

import dbbstation.nc.dialects
from dbbstation.errors import InputError, StationError
from dbbstation.files.own_dialects import dialect_given
from dbbstation.machine.geometry import Rotation
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.dialect import Dialect
from dbbstation.nc.dialects.linuxcnc import LinuxCNC
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.registry import GROUP, dialect_named, dialect_of_file, known_dialects
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind, ToolpathBuilder
from dbbstation.nc.trial import faults_of
from dbbstation.nc.words import CannotSayError

ONE_FILE = '''
"""A dialect for a test."""

from dbbstation.nc.dialect import Dialect
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.export import Inverse, compensated_program


class Shouting(Dialect):
    name = "shouting"
    extension = ".loud"
    what = "a control that shouts"

    def write(self, toolpath, header=()):
        return "\\n".join(["GO!"] * len(toolpath))

    def read(self, text, name, *, start=None):
        raise NotImplementedError
'''


@pytest.fixture
def one_more(tmp_path, monkeypatch):
    (tmp_path / "shouting_dialect.py").write_text(ONE_FILE)
    monkeypatch.setattr(dbbstation.nc.dialects, "__path__", [*dbbstation.nc.dialects.__path__, str(tmp_path)])
    known_dialects.cache_clear()
    yield
    known_dialects.cache_clear()


@pytest.mark.usefixtures("one_more")
def test_a_file_in_the_folder_is_a_dialect():
    assert {"linuxcnc", "shouting"} <= set(known_dialects())
    path = ToolpathBuilder("x")
    path.rapid(np.zeros(6))
    assert dialect_named("shouting").write(path.built()) == "GO!"
    assert dialect_of_file("a/B.LOUD", "GO!").name == "shouting"


def test_an_unknown_dialect_is_refused_with_the_known_ones():
    with pytest.raises(StationError, match=r"known are .*linuxcnc"):
        dialect_named("shouting")


@pytest.mark.parametrize("file", ["part.ngc", "PART.NC", "part.tap", "part.gcode"])
def test_programs_of_other_posts_are_read_by_their_usual_endings(file):
    assert dialect_of_file(file, "G21").name == "linuxcnc"


def test_every_dialect_describes_itself():
    for name, dialect in known_dialects().items():
        assert dialect.name == name
        assert dialect.extension.startswith(".")
        assert dialect.what


class Beginning:
    """A dialect of `.ngc` files that begin with its own word."""

    name: ClassVar[str]

    def write(self, toolpath, header=()):
        raise NotImplementedError

    def read(self, text, name, *, start=None):
        raise NotImplementedError

    def is_in(self, text):
        return text.startswith(self.name)


@pytest.fixture
def two_of_one_ending(monkeypatch):
    def kind(name):
        return type(name, (Beginning, Dialect), {"name": name, "extension": ".loud", "what": "a control"})

    points = [EntryPoint(kind("alpha")), EntryPoint(kind("beta"))]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: points if group == GROUP else [])
    known_dialects.cache_clear()
    yield
    known_dialects.cache_clear()


class EntryPoint:
    """One of an installed package."""

    def __init__(self, kind):
        self.name = self.value = kind.name
        self.dist = None
        self.load = lambda: kind


@pytest.mark.usefixtures("two_of_one_ending")
def test_two_dialects_with_one_ending_are_told_apart_by_the_program():
    assert dialect_of_file("x.loud", "alpha 1").name == "alpha"
    assert dialect_of_file("x.loud", "beta 1").name == "beta"
    with pytest.raises(
        StationError, match=r"x.loud: the program may be in several NC dialects: alpha, beta; .*--written-in"
    ):
        dialect_of_file("x.loud", "gamma 1")


def test_a_package_with_a_name_that_is_taken_is_told(monkeypatch):
    taken = type("Taken", (Beginning, Dialect), {"name": "linuxcnc", "extension": ".x", "what": "a control"})
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda *, group: [EntryPoint(taken)] if group == GROUP else []
    )
    known_dialects.cache_clear()
    with pytest.raises(InputError, match="an NC dialect `linuxcnc` is known already, from dbbstation itself"):
        known_dialects()
    known_dialects.cache_clear()


OWN = """
from dbbstation.nc.dialects.linuxcnc import LinuxCNC


class Own(LinuxCNC):
    name = "own"
    extension = ".own"
    what = "a control of one's own"
"""


def test_a_dialect_of_ones_own_is_given_by_its_file(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    dialect = dialect_given(str(tmp_path / "own.py"))
    assert (dialect.name, dialect.extension) == ("own", ".own")
    assert dialect_given("linuxcnc") is dialect_named("linuxcnc")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('    name = "own"\n', "    name = None\n", r"own\.py:5: Own: it needs `name`, a text; see `A new dialect`"),
        ('".own"', '"own"', r"own\.py:5: Own: its `extension` must begin with a dot"),
        ("class Own(LinuxCNC)", "class Own", r"own\.py: no class in it derives from Dialect"),
        (
            "class Own",
            "class Other(LinuxCNC):\n    name = 'other'\n\n\nclass Own",
            "several dialects in it: Other, Own",
        ),
        (
            "    what",
            "    def read(self, text, name, *, start=None):\n        return None\n\n    what",
            "AttributeError",
        ),
        (
            "    what",
            "    def write(self, path, header=()):\n        return LinuxCNC.write(self, path).replace('X10.5', 'X9.5')\n\n    what",
            "it does not read the two moves that it wrote",
        ),
    ],
)
def test_what_a_dialect_of_ones_own_lacks_is_told(tmp_path, old, new, why):
    assert old in OWN
    (tmp_path / "own.py").write_text(OWN.replace(old, new))
    with pytest.raises(InputError, match=why):
        dialect_given(str(tmp_path / "own.py"))


def own(tmp_path, body: str) -> str:
    (tmp_path / "own.py").write_text(f"import re\n{OWN}\n{textwrap.indent(textwrap.dedent(body), '    ')}\n")
    return str(tmp_path / "own.py")


def editing(edit: str) -> str:
    return f"def write(self, path, header=()):\n    text = LinuxCNC.write(self, path, header)\n    return {edit}\n"


SABOTAGE = {
    "ten times the feed": (editing("re.sub('F600', 'F6000', text)"), r"wrote `feed in mm/min 600` and reads `.* 6000`"),
    "no dwells": (editing("re.sub('G4 .*\\n', '', text)"), r"it loses `dwell in s 0\.5` \(dwells\)"),
    "no stops": ("def pause(self, text):\n    return f'({text})'", r"wrote `pause` and reads `feed to"),
    "stops that cannot be switched off": (
        editing("text.replace('M1\\n', 'M0\\n')"),
        r"wrote `optional stop` and reads `pause`",
    ),
    "no spindle": (editing("re.sub('S1200 M3\\n', '', text)"), r"it loses `S1200`"),
    "the spindle the other way": (editing("text.replace('S1200 M3', 'S1200 M4')"), r"wrote `M3` and reads `M4`"),
    "a spindle without decimals": (editing("text.replace('S0.00001', 'S0')"), r"wrote `S0\.00001` and reads `S0`"),
    "no coolant": (editing("text.replace('M8\\n', '')"), r"it loses `M8` \(coolant\)"),
    "a tool dropped": (
        "def function(self, words):\n    return re.sub('T.*', '(no tool)', words)",
        r"it loses `T2` \(a tool\)",
    ),
    "no messages": (editing("re.sub(r'\\(MSG, hello\\)', '', text)"), r"it loses `message MSG, hello`"),
    "no work system": (editing("text.replace('G55\\n', '')"), r"it loses `system G55`"),
    "no machine coordinates": (editing("text.replace('G53 ', '')"), r"wrote `rapid in machine coordinates to"),
    "its decimals": (
        "decimals = (3, 3, 3, 3, 3, 3)\n\ndef read(self, text, name, *, start=None):\n    return super().read(re.sub(r'([XYZABC]-?\\d+\\.\\d\\d)\\d', r'\\1', text), name, start=start)",
        r"it cannot be marked: what it writes with 3 3 3 3 3 3 decimals is read otherwise",
    ),
    "no exact stop": (editing("text.replace('G61\\n', '')"), r"path control"),
    "its comments": ("words = {**LinuxCNC.words, 'comment': '({text})'}", r"it does not read its own comments"),
    "no guard": ("def guard(self, holds):\n    return ()", r"it loses the check of offsets"),
    "M2 for M30": (editing("text.replace('M30', 'M2')"), r"wrote `end by M30` and reads `end by M2`"),
    "stops before dwells": (
        editing("re.sub(r'(G4 P12.25)\\n((?:.*\\n)*?)(M0)\\n', r'\\3\\n\\2\\1\\n', text)"),
        r"\(all in one program\)",
    ),
}


@pytest.mark.parametrize("what", SABOTAGE)
def test_a_dialect_that_drops_or_changes_anything_is_refused(tmp_path, what):
    body, why = SABOTAGE[what]
    with pytest.raises(InputError, match=why):
        dialect_given(own(tmp_path, body))


def test_a_dialect_that_says_what_it_has_no_words_for_is_taken(tmp_path, crooked):
    body = """
        def optional_stop(self):
            raise self.cannot_say("an optional stop (M1)")
    """
    dialect = dialect_given(own(tmp_path, body))
    path = read_program("G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X1 F100\nM1\nM2\n", "part.ngc")
    with pytest.raises(CannotSayError, match=r"part\.ngc:4: the dialect own has no words for an optional stop \(M1\)"):
        compensated_program(path, dialect, Inverse(crooked))


def test_a_line_longer_than_the_control_reads_is_refused(linuxcnc, table2):
    path = circle_toolpath(table2.tests["a"].circle, "run")
    longest = max(map(len, linuxcnc.write(path).splitlines()))
    kinds = [type("Short", (LinuxCNC,), {"longest_block": longest - less}) for less in (0, 1)]
    assert kinds[0]().write(path) == linuxcnc.write(path)
    with pytest.raises(CannotSayError, match=f"a line of more than {longest - 1} characters"):
        kinds[1]().write(path)


def test_a_stop_with_its_message_may_be_read_as_two_rows(tmp_path):
    body = """
        def read(self, text, name, *, start=None):
            return super().read(text.replace("M0", "(note)\\nM0"), name, start=start)
    """
    assert dialect_given(own(tmp_path, body)).name == "own"


def test_a_dialect_learns_which_of_the_programs_it_writes(tmp_path, table2, reference):
    body = """
        def file_name(self, stem, run):
            return f"O{run:04}{self.extension}"

        def before_header(self, toolpath):
            return [f"(O{toolpath.run:04} {toolpath.name[:24]})"]

        def end(self, toolpath):
            if toolpath.ending.value == "%":
                raise self.cannot_say("an end without M2")
            return [toolpath.ending.value]
    """
    dialect = dialect_given(own(tmp_path, body))
    programs = circle_programs(table2, reference, dialect, tests=["a", "b"])
    assert [each.file for each in programs] == ["O0001.own", "O0002.own", "O0003.own", "O0004.own"]
    assert programs[2].text.startswith("(O0003 test b ")


def test_a_program_that_moves_nothing_is_refused_whatever_reads_it():
    with pytest.raises(InputError, match="this program moves nothing"):
        dialect_named("sinumerik840d").toolpath("M30\n", "empty.mpf")


@pytest.mark.parametrize("name", known_dialects())
def test_every_dialect_reads_what_it_writes(name):
    if name != "poses":  # a table of moves, in which a rapid may have no F
        assert faults_of(dialect_named(name)) == []


@pytest.mark.parametrize(
    "line",
    [
        "G2 X1 Y1 I1",
        "G1",
        "G1 X",
        "G1 X1e3",
        "G0 X5 U1",
        "SUPA X5",
        "T1",
        "M6",
        "M48",
        "M17",
        "G58",
        "G4 S3",
        "G641",
        "TRANS X10",
        "X5",
    ],
)
def test_840d_refuses_what_it_does_not_write_with_its_line(line):
    with pytest.raises(InputError, match=r"p\.mpf:3:1: .*is not read"):
        dialect_named("sinumerik840d").read(f"G0 X0 Y0 Z0 A0 B0 C0\nG1 X1 F100\n{line}\nM2\n", "p.mpf")


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("table-ccw", "table_ccw.mpf"),
        ("a-cw", "NC_a_cw.mpf"),
        ("part.ngc", "part_ngc.mpf"),
        ("x" * 30, f"{'x' * 22}_7.mpf"),
    ],
)
def test_names_of_840d_are_those_that_it_allows(stem, name):
    """24 letters, digits and underscores, two letters first [Fundamentals 11/2006, page 62]."""
    assert dialect_named("sinumerik840d").file_name(stem, 7) == name


def test_840d_commands_what_linuxcnc_does(linuxcnc, crooked, table2):
    dialect = dialect_named("sinumerik840d")
    part = "G21 G90 G54\nG0 X0 Y0 Z-1000 A0 B0 C0\nS800 M3\nG61\nG1 X50 F500\n(MSG, turn it)\nM0\nG4 P0.5\nG1 A5 F60\nM30\n"
    path = read_program(part, "part.ngc")
    texts = [compensated_program(path, one, Inverse(crooked)).text for one in (linuxcnc, dialect)]
    runs = [
        circle_programs(table2, crooked.machine, one, inverse=Inverse(crooked), tests=["g"])
        for one in (linuxcnc, dialect)
    ]
    texts += [programs[0].text for programs in runs]
    for one, other in ((texts[0], texts[1]), (texts[2], texts[3])):
        mine, yours = (
            each.only(np.flatnonzero(each.kind != RowKind.COMMENT))
            for each in (linuxcnc.read(one, "x.ngc"), dialect.read(other, "x.mpf"))
        )
        np.testing.assert_array_equal(mine.kind, yours.kind)
        np.testing.assert_array_equal(mine.poses, yours.poses)
        np.testing.assert_array_equal(mine.corners_mm, yours.corners_mm)
        np.testing.assert_allclose(mine.duration_s, yours.duration_s, rtol=1e-12)
        assert mine.ending == yours.ending
    with pytest.raises(CannotSayError, match="no words for G59"):
        dialect.write(read_program(part.replace("G54", "G59"), "part.ngc"))


WITH_TCP = """
from types import MappingProxyType

from dbbstation.errors import InputError
from dbbstation.machine.geometry import Rotation
from dbbstation.nc.dialects.sinumerik840d import Sinumerik840D


class Tip(Sinumerik840D):
    name = "tip"
    what = "a control with TCP"
    rotation = Rotation.ZYX
    comment_letters = "A-Z0-9 .:"
    words = MappingProxyType({**Sinumerik840D.words, "tcp on": "TRAORI", "tcp off": "TRAFOOF"})

    def read(self, text, name, *, start=None):
        lines = text.splitlines()
        if "TRAORI" not in lines:
            raise InputError.of(name, "TCP is off", "write TRAORI")
        return super().read("\\n".join("" if line.startswith("TRA") else line for line in lines), name, start=start)
"""


@pytest.fixture
def tip(tmp_path):
    (tmp_path / "tip.py").write_text(WITH_TCP.replace("\\\\", "\\"))
    return dialect_given(str(tmp_path / "tip.py"))


def turned(poses, order):
    """Return orientations by SciPy, which names turns about fixed axes in small letters, and about carried ones in capitals."""
    return Turn.from_euler(order, poses[:, 3:] if order == "XYZ" else poses[:, :2:-1], degrees=True)


TILTING = "G21 G90\n(part: flansch, 7)\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X50 A12 B-10 C3 F500\nY30\nM2\n"


def test_angles_are_written_in_the_order_of_the_control(tip, linuxcnc, crooked):
    """The same tips and orientations as in LinuxCNC's program, which has the machine's order."""
    path = read_program(TILTING, "part.ngc")
    assert crooked.machine.hexapod.rotation is Rotation.XYZ
    programs = [compensated_program(path, each, Inverse(crooked)) for each in (linuxcnc, tip)]
    here, there = (one.toolpath(each.text, each.file) for one, each in zip((linuxcnc, tip), programs, strict=True))
    assert there.rotation is Rotation.ZYX
    one, other = (each.poses[each.is_move & (each.line > 0)] for each in (here, there))
    ends = [
        np.flatnonzero(np.hypot(each[:, 0] - 50.0, each[:, 1] - y) < 2.0)[-1]
        for y in (0.0, 30.0)
        for each in (one, other)
    ]
    for mine, yours in (ends[:2], ends[2:]):
        np.testing.assert_allclose(one[mine, :3], other[yours, :3], atol=3e-6)
        assert np.abs(one[mine, 3:] - other[yours, 3:]).max() > 1.0
        off = turned(one[[mine]], "XYZ") * turned(other[[yours]], "ZYX").inv()
        assert np.degrees(off.magnitude()[0]) < 1e-6
    again = there.in_order(Rotation.XYZ)
    np.testing.assert_allclose(again.poses[-1], here.poses[-1], atol=3e-6)


def test_the_whole_path_has_the_orientations_that_the_program_wants(tip, reference):
    """A machine without errors: along the straight turn of the nominal program, at every end of a piece."""
    path = read_program(TILTING, "part.ngc")
    machine = replace(reference, acceleration_mm_s2=5e4)
    there = tip.toolpath(compensated_program(path, tip, Inverse(MachineModel(machine))).text, "part.mpf")
    poses = there.poses[there.is_move]
    poses = poses[(poses[:, 1] < 1e-9) & (poses[:, 0] > 0.1)]
    assert len(poses) > 10
    wanted = np.column_stack([poses[:, :3], poses[:, :1] / 50.0 * np.array([[12.0, -10.0, 3.0]])])
    off = turned(wanted, "XYZ") * turned(poses, "ZYX").inv()
    assert 1e5 * off.magnitude().max() < 0.15  # µm at 100 mm from the tip


def test_tcp_is_turned_on_and_off_and_comments_keep_to_the_alphabet(tip, crooked):
    program = compensated_program(read_program(TILTING, "part.ngc"), tip, Inverse(crooked))
    lines = program.text.splitlines()
    assert lines[-2:] == ["TRAFOOF", "M2"]
    first = next(at for at, line in enumerate(lines) if line.startswith("G0"))
    assert "TRAORI" in lines[:first]
    comments = [line[2:] for line in lines if line.startswith("; ")]
    assert "PART: FLANSCH  7" in comments
    assert all(re.fullmatch("[A-Z0-9 .:]*", each) for each in comments)
    with pytest.raises(StationError, match="compensated already, says its header"):
        compensated_program(tip.toolpath(program.text, program.file), tip, Inverse(crooked))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('"TRAORI" not in lines', "False", "reads X, Y and Z as the tool tip without `TRAORI`"),
        ("Rotation.ZYX", "'ZYX'", "its `rotation` is no Rotation"),
    ],
)
def test_what_does_not_come_back_is_refused(tmp_path, old, new, why):
    text = WITH_TCP.replace("\\\\", "\\")
    assert old in text
    (tmp_path / "tip.py").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=why):
        dialect_given(str(tmp_path / "tip.py"))
