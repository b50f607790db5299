"""Which sessions an acceptance can compare, and that the way back stays."""

from __future__ import annotations

import hashlib
import shutil
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.plan import Direction
from dbbstation.service.after import USUAL, After
from dbbstation.service.former_sessions import Former, InForce, before_and_now, keep_models
from dbbstation.service.live_trace import last_traces
from dbbstation.service.work import Call, SessionTask, WorkProgress
from tests.plant.mechanisms.balls import CmmScatter
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import BEGUN, Program, record
from tests.service.test_front import Scripted

MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
MODEL_SHA256 = hashlib.sha256(MODEL.read_bytes()).hexdigest()
GONE = "0" * 64


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four sessions of one plan, a week apart: nominal, compensated by a model that is there and by one that is gone, and now."""
    shop = tmp_path_factory.mktemp("shop")
    plan = subset(table_ii_plan(4), ["a"])
    models = {"nominal": None, "there": MODEL_SHA256, "gone": GONE, "now": MODEL_SHA256}
    for week, (name, sha256) in enumerate(models.items()):
        programs = {} if sha256 is None else {key: Program("G1 X0\n", sha256) for key in ("a-cw", "a-ccw")}
        record(shop / name, seed=week, plan=plan, rate_hz=5.0, begun=BEGUN + timedelta(weeks=week), programs=programs)
    (shop / "nominal-results").mkdir()
    shutil.copy(MODEL, shop / "nominal-results" / "model.yaml")
    return shop


@pytest.fixture
def shop(recorded: Path, tmp_path: Path) -> Path:
    return shutil.copytree(recorded, tmp_path / "shop")


def names(shop: Path, session: str = "now") -> list[str]:
    return [one.folder.name for _, one in former_sessions(read_session(shop / session), shop)]


def test_sessions_that_ended_before_are_offered_the_last_first(shop: Path) -> None:
    assert names(shop) == ["gone", "there", "nominal"]
    assert names(shop, "there") == ["nominal"]
    assert names(shop, "nominal") == []


def test_another_machine_ball_or_serial_number_is_not_the_same(shop: Path) -> None:
    machine = shop / "gone" / "machine.yaml"
    machine.write_text(_moved(machine.read_text("utf-8")), "utf-8")
    plan = subset(table_ii_plan(4), ["f"])
    record(shop / "other-test", seed=9, plan=plan, rate_hz=5.0, begun=BEGUN + timedelta(days=1), setup=[CmmScatter()])
    for name, serial in (("there", "H-8"), ("now", "H-7")):
        file = shop / name / "session.yaml"
        file.write_text(file.read_text("utf-8") + f"serial_number: {serial}\n", "utf-8")
    assert names(shop) == ["nominal"]


def _moved(machine: str) -> str:
    lines = machine.splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if line.startswith("platform_joints_mm"))
    row = next(k for k in range(at, len(lines)) if any(sign.isdigit() for sign in lines[k]) and "." in lines[k])
    place = lines[row].index(".") + 1
    lines[row] = lines[row][:place] + "9" + lines[row][place:]
    return "".join(lines)


def test_what_the_circles_ran_by_is_told_with_the_files_that_are_found(shop: Path) -> None:
    found = before_and_now(shop / "now")
    model = shop / "nominal-results" / "model.yaml"
    assert (found.now.circles, found.now.compensated, found.now.models) == (2, 2, (model,))
    gone, there, nominal = (one.in_force for one in found.formers)
    assert (gone.compensated, gone.models, gone.lost) == (2, (), (GONE,))
    assert (there.models, there.lost, there.programs) == ((model,), (), shop / "there" / "programs")
    assert nominal == InForce(circles=2, compensated=0, programs=None)


def test_the_model_in_force_before_is_copied_once_and_never_overwritten(shop: Path, tmp_path: Path) -> None:
    former = before_and_now(shop / "now").formers[1]
    (copy,) = keep_models(former, tmp_path)
    assert copy.read_bytes() == MODEL.read_bytes()
    stamp = copy.stat().st_mtime_ns
    assert keep_models(former, tmp_path) == (copy,)
    assert copy.stat().st_mtime_ns == stamp
    # Another model has another name.
    other = tmp_path / "other.yaml"
    other.write_bytes(MODEL.read_bytes() + b"# changed\n")
    changed = Former(former.folder, former.measured, InForce(2, 2, None, (other,)))
    assert keep_models(changed, tmp_path) != (copy,)
    assert copy.read_bytes() == MODEL.read_bytes()


def test_an_acceptance_is_the_report_of_both_sessions(shop: Path) -> None:
    begun: list[Scripted] = []

    def start(call: Call, folder: Path) -> Scripted:
        begun.append(Scripted(call, folder))
        return begun[-1]

    after = After(shop / "now", start=start)  # type: ignore[arg-type]
    assert not after.can(SessionTask.ACCEPTANCE)
    assert SessionTask.ACCEPTANCE not in USUAL
    after.accept(before_and_now(shop / "now").formers[1])
    (work,) = begun
    assert (work.call.task, work.call.given["sessions"], work.call.given["before"]) == (
        "report",
        str(shop / "now"),
        str(shop / "there"),
    )
    work.progress = WorkProgress.DONE
    after.look()
    assert after.results[SessionTask.ACCEPTANCE].path == after.folder / "acceptance.html"
    assert [path.parent for path in after.kept] == [after.folder]


def test_the_last_circles_of_a_test_come_from_disk_with_their_lengths(shop: Path) -> None:
    traces = last_traces(shop / "now", "a")
    assert set(traces) == {Direction.CCW, Direction.CW}
    for direction, trace in traces.items():
        (file,) = (shop / "gone" / "runs").glob(f"a-{direction}*.csv")
        rows = [row.split(",") for row in file.read_text("utf-8").splitlines() if not row.startswith("#")]
        column = rows[0].index("length_mm")
        lengths = {round(float(row[column]), 6) for row in rows[1:]}
        measured = np.round(trace.circle.bar_mm + trace.deviation_um / 1e3, 6)
        assert len(trace) > 100
        assert set(measured.tolist()) <= lengths
        assert trace.centred is not None
        # About its own centre the first undulation is gone.
        once = np.exp(-1j * np.radians(trace.theta_deg))
        assert abs(np.mean(trace.centred.deviation_um * once)) < 0.1 * abs(np.mean(trace.deviation_um * once)) + 0.1
    assert last_traces(shop / "now", "no such test") == {}
    assert last_traces(shop / "nominal", "a") == {}


def test_a_session_with_a_damaged_run_is_passed_over(shop: Path) -> None:
    newest = last_traces(shop / "now", "a")[Direction.CW].deviation_um
    (file,) = (shop / "gone" / "runs").glob("a-ccw*.csv")
    file.write_text("no run", "utf-8")
    assert names(shop) == ["there", "nominal"]
    traces = last_traces(shop / "now", "a")
    assert set(traces) == {Direction.CCW, Direction.CW}
    assert not np.array_equal(traces[Direction.CW].deviation_um, newest)
