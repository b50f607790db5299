"""What is spoilt: files of every format that the program reads, each with the commands that read it."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.files.places import shipped_folder
from tests.fuzz.mutate import SOUND

if TYPE_CHECKING:
    from pathlib import Path

FIXTURES, PROTOCOLS = shipped_folder("fixtures"), shipped_folder("protocols")


@dataclass(frozen=True)
class Seed:
    """Files of one kind with commands that read them.

    Attributes:
        files: contents by path in the folder of the case.
        commands: lines, each with its share; they run in the folder of the case and write into `out/`.
        share: how often this seed is taken, against the others.
    """

    kind: str
    files: dict[str, bytes] = field(repr=False)
    commands: dict[str, float]
    share: float

    @property
    def targets(self) -> list[str]:
        return [name for name in self.files if not name.startswith(SOUND)]


def _of(folder: Path, within: str) -> dict[str, bytes]:
    return {
        f"{within}{path.relative_to(folder).as_posix()}": path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".gitattributes"
    }


def _sound(**files: Path) -> dict[str, bytes]:
    return {f"{SOUND}{name}{path.suffix}": path.read_bytes() for name, path in files.items()}


MODEL = FIXTURES / "models" / "small.yaml"
MACHINE = FIXTURES / "machines" / "reference.yaml"
PLAN = PROTOCOLS / "plans" / "ten-minute-check.yaml"
JIG = FIXTURES / "jigs" / "reference-plate.yaml"

PROGRAM = b"""%
G21 G90 G17
(written by hand)
G1 X0 Y0 Z-1000 A0 B0 C0 F1000
G1 X5 Y10
G3 X5 Y30 I0 J10 F500
G91 G1 X-1 (a comment)
M2
%
"""

PARAMETERS = (
    PROGRAM.replace(b"X5", b"X#1").replace(b"F500", b"F[500+#1]").replace(b"G1 X0", b"#1=[5*2]\nO100 CALL\nG1 X0", 1)
)

LOG = b"""# dbb-byte-log/1
# instrument: streaming-encoder
# profile: no-checksum
# port: /dev/ttyUSB0
       0.100000 < 30 30 30 30 36 2c 2b 30 31 35 30 2e 30 30 30 33 31 2c 41 0d 0a  | 00006,+0150.00031,A..
       0.200000 < 30 30 30 30 37 2c 2b 30 31 35 30 2e 30 30 30 33 31 2c 41 0d 0a  | 00007,+0150.00031,A..
       0.300000 > 02  | .
       0.400000 < 30 30 30 30 39 2c 2b 30 31 35 30  | 00009,+0150
"""

POSES = b"x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n1.5,0,-1008,0,1,0\n-1,2,-1000,0,0,-1\n"

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="tank" guid="{t}"><CoSimulation modelIdentifier="t"/><ModelVariables>
<ScalarVariable name="rate" valueReference="0" causality="parameter"><Real start="0.4"/></ScalarVariable>
</ModelVariables><ModelStructure/></fmiModelDescription>
"""

OF_FMU = b"""format: dbb-simulator/1
name: tank
fmu: ../t.fmu
time: t_s
inputs: {pump: pump}
outputs: {level: {column: level_m, unit: m}}
ports: {flow: {about: what else flows in, unit: m/s, signals: {level: m}}}
"""

RUN = b"# test: a\n# direction: ccw\n# repeat: 1\nt_s,length_mm,bar_temp_c,note,status\n" + b"".join(
    f"{i / 10:.1f},{150 + i % 7 / 1000:.4f},20.{i % 3},x{i},ok\n".encode() for i in range(60)
)


def _archives() -> list[Seed]:
    """An FMU without a library; archives and its description are spoilt."""
    found = io.BytesIO()
    with zipfile.ZipFile(found, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.writestr("resources/x", bytes(900))
    rows = b"".join(b"%.2f,0.5,%.4f\n" % (k / 4, 1 + k % 7 / 100) for k in range(40))
    files = {"t.fmu": found.getvalue(), f"{SOUND}m.yaml": OF_FMU, f"{SOUND}r.csv": b"t_s,pump,level_m\n" + rows}
    line = f"mismatch {SOUND}r.csv --simulator {SOUND}m.yaml --allow --no-held-out"
    return [Seed("FMU", files, {line: 1, f"check {SOUND}m.yaml": 1}, 0.05)]


def _seeds() -> list[Seed]:
    seeds = [
        Seed(f"{name} {path.stem}", {path.name: path.read_bytes()}, {f"check {path.name}": 1}, share)
        for name, share, paths in (
            ("plan", 1, [PLAN, PROTOCOLS / "plans" / "conventional.yaml"]),
            ("machine", 1, [MACHINE, FIXTURES / "machines" / "every-key.yaml"]),
            ("jig", 1, [JIG]),
            ("settings", 1, sorted((FIXTURES / "settings").glob("*.yaml"))),
            ("model", 1, sorted((FIXTURES / "models").glob("*.yaml"))),
            ("bar", 1, sorted((FIXTURES / "bars").glob("*.yaml"))),
            ("instrument", 0.5, sorted((PROTOCOLS / "instruments").glob("*.yaml"))),
            ("mapping", 1, sorted((FIXTURES / "mappings").glob("*.yaml"))),
        )
        for path in paths
    ]
    seeds += [
        Seed(
            "plan with a jig file",
            {
                "plans/file.yaml": (FIXTURES / "plans" / "every-key.yaml").read_bytes(),
                "jigs/reference-plate.yaml": JIG.read_bytes(),
            },
            {"check plans/file.yaml": 1},
            1,
        ),
        Seed("run", {"a.csv": RUN}, {"check a.csv": 1}, 3),
        Seed("run that was cut", {"a.csv.part": RUN}, {"check a.csv.part": 1}, 2),
        Seed(
            "plan with a machine",
            {"plan.yaml": PLAN.read_bytes(), "machine.yaml": MACHINE.read_bytes()},
            {
                "check plan.yaml machine.yaml --json": 2,
                "program --plan plan.yaml --machine machine.yaml --out out/nc": 1,
                "program --plan plan.yaml --machine machine.yaml --dialect linuxcnc --step-deg 5 --out out/nc": 1,
            },
            0.5,
        ),
        Seed(
            "settings in force",
            {"file.yaml": (FIXTURES / "settings" / "every-key.yaml").read_bytes()},
            {"--settings file.yaml settings": 1, "--settings file.yaml sources": 1},
            1,
        ),
        Seed(
            "model in use",
            {"model.yaml": MODEL.read_bytes(), **_sound(plan=PLAN, machine=MACHINE), f"{SOUND}poses.csv": POSES},
            {
                f"predict --model model.yaml {SOUND}poses.csv --table out/p.csv": 3,
                f"program --plan {SOUND}plan.yaml --machine {SOUND}machine.yaml --model model.yaml --out out/nc": 0.3,
            },
            1,
        ),
        Seed(
            "poses",
            {"poses.csv": POSES, **_sound(model=MODEL)},
            {f"predict --model {SOUND}model.yaml poses.csv --table out/p.csv": 1},
            2,
        ),
        Seed(
            "NC program",
            {"a.ngc": PROGRAM, **_sound(model=MODEL)},
            {f"compensate a.ngc --model {SOUND}model.yaml --out out/a.ngc": 1},
            3,
        ),
        Seed(
            "NC program with parameters",
            {"a.ngc": PARAMETERS, **_sound(model=MODEL)},
            {f"compensate a.ngc --model {SOUND}model.yaml --out out/a.ngc": 1},
            1,
        ),
        Seed(
            "byte log",
            {"log.txt": LOG},
            {
                "replay log.txt": 3,
                "instrument replay log.txt --json": 3,
                "instrument replay log.txt --instrument heidenhain-nd281b": 1,
                "instrument replay log.txt --instrument mahr-c1202 --zero-mm 150": 1,
                **{
                    f"instrument replay log.txt --json --instrument {path.stem}": 0.3
                    for path in sorted((PROTOCOLS / "instruments").glob("*.yaml"))
                },
            },
            4,
        ),
        *_archives(),
        Seed(
            "table",
            {"t.csv": b"".join((FIXTURES / "tables" / "axis.csv").read_bytes().splitlines(keepends=True)[:45])},
            {
                "mismatch t.csv --measured measured_mm --simulated simulated_mm --no-held-out": 4,
                "mismatch t.csv --measured measured_mm --simulated simulated_mm --no-held-out --json --table out/t.csv": 1,
            },
            0.6,
        ),
        Seed(
            "recording of a drive",
            {"d.csv": b"".join((FIXTURES / "drives" / "strut.csv").read_bytes().splitlines(keepends=True)[:1300])},
            {"check d.csv": 8, "drive d.csv": 0.2},
            3,
        ),
        Seed(
            "CMM sheet",
            {"s.csv": (FIXTURES / "cmm" / "plate.csv").read_bytes(), **_sound(jig=JIG)},
            {f"jig sheet s.csv --jig {SOUND}jig.yaml --u-um 0.8 --out out/j.yaml": 1},
            3,
        ),
        Seed(
            "CMM report",
            {"s.dmo": (FIXTURES / "cmm" / "plate.dmo").read_bytes(), **_sound(jig=JIG)},
            {f"jig sheet s.dmo --jig {SOUND}jig.yaml --u-um 0.8 --out out/j.yaml": 1},
            3,
        ),
        Seed(
            "mountings",
            {"s.csv": (FIXTURES / "cmm" / "mountings.csv").read_bytes(), **_sound(jig=JIG)},
            {f"jig holders s.csv --jig {SOUND}jig.yaml --out out/j.yaml": 1},
            2,
        ),
        Seed(
            "recording made elsewhere",
            {
                "a_links.csv": (FIXTURES / "foreign" / "a_links.csv").read_bytes(),
                "map.yaml": (FIXTURES / "mappings" / "every-key.yaml").read_bytes(),
                **_sound(plan=PROTOCOLS / "plans" / "table2.yaml", machine=MACHINE),
            },
            {
                f"import a_links.csv --out out/s --plan {SOUND}plan.yaml --machine {SOUND}machine.yaml --mapping map.yaml "
                "--yes --ambient-temp-c 20 --not-known operator --not-known job --not-known bar": 1
            },
            2,
        ),
        Seed(
            "own source",
            {"own.py": (FIXTURES / "sources" / "scale_bow.py").read_bytes()},
            {"sources --source-files own.py": 1},
            1,
        ),
    ]
    for name, share in (("small", 1.5), ("logged", 0.7), ("under-spindle", 0.7), ("begun", 1.0)):
        files = _of(FIXTURES / "sessions" / name, "s/")
        commands = {
            "check s": 3,
            "session list s": 8,
            "session list s --json": 3,
            "export s --out out/e.csv": 3,
            "history . --table out/h.csv": 1,
            "circles s --table out/c.csv": 1.5,
            "circles s --json": 1,
            f"evaluate s --model {SOUND}model.yaml": 1,
            "calibrate s": 0.3,
            "report s --page out/r.html": 0.2,
            "plot s --out out/p.svg": 0.1,
            "session reject s a-ccw-1 --reason spoilt": 1,
            "session seal s": 1,
        }
        seeds.append(Seed(f"session {name}", {**files, **_sound(model=MODEL)}, commands, share))
    return seeds


SEEDS = _seeds()
