"""Programs in the habits of twenty-three posts: read as they are and as LinuxCNC reads them, and written so that it runs the same.

`DBBSTATION_FUZZ=5000` tries as many. `nc_files` of the installed LinuxCNC are read too.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Motion
from tests.nc.interpreter import events, needs_rs274
from tests.nc.posts import POSTS, program
from tests.nc.test_curves import CHORDS_MM, previewed
from tests.nc.test_fuzz_rs274 import difference, moving
from tests.nc.test_look_alikes import to_the_path_mm
from tests.nc.test_through_rs274 import in_inches
from tests.nc.through_rs274 import MOVES, said

pytestmark = needs_rs274

COUNT = int(os.environ.get("DBBSTATION_FUZZ", "0"))
BY_DAY = range(COUNT) or [place + len(POSTS) * (place % 2) for place in range(len(POSTS))]
"""One program of each post; every other one leaves the reference point to the control."""

BY_NIGHT = sorted(set(range(max(COUNT, 2 * len(POSTS)) + len(POSTS))) - set(BY_DAY))

PLACES = {"G54": (5.0, -8.0, -1000.0, 0.0, 0.0, 0.0), "G28": (0.0, 0.0, -945.0, 0.0, 0.0, 0.0)}
LENGTHS = {1: (0.0, 0.0, 12.5, 0.0, 0.0, 0.0), 2: (0.0, 0.0, -3.25, 0.0, 0.0, 0.0)}
SETUP = ControlSetup(PLACES, LENGTHS)
STORED = {
    number + axis: values[axis] / 25.4
    for number, values in ((5221, PLACES["G54"]), (5161, PLACES["G28"]))
    for axis in range(3)
}
TOOLS = "".join(f"T{tool} P{tool} Z{length[2] / 25.4:.9f}\n" for tool, length in LENGTHS.items())
THREE_AXES = np.array([np.nan] * 3 + [0.0] * 3)


def as_linuxcnc_takes_it(text: str) -> str:
    """With an end, with G0 behind G80 and not beside it, where other controls have both; at rest in all axes before."""
    text = text if re.search(r"M0?2|M30|\A%", text) else f"%\n{text}%\n"
    text = re.sub(r"(?m)^((?:N\d+ ?)?G80)$", r"\1\nG0", text)
    text = re.sub(r"(?m)^(N\d+ ?)?G0?0 (.*)G80(.*)$", r"\1G80\nG0 \2\3", text)
    text = re.sub(r"(?m)^(N\d+ ?)?(G05.1|G187).*$| G50\b| D3\d\b", "", text)
    return re.sub(r"(?m)^(N\d+ ?)?(G0 G20 .*)$", r"\2", text)


def along(path, done, model) -> tuple[float, list[np.ndarray]]:
    """How far the tool leaves the nominal moves at feed [mm], and the ends of nominal moves that it does not come to, in order."""
    moves = [event for event in done if event.kind in MOVES]
    moves = moves[int(np.argmin(path.unknown[path.is_move] != 0)) :]
    poses = np.array([event.pose for event in moves])
    feeds = np.array([event.kind == "FEED" for event in moves])
    tool = model.actual_poses(Motion(poses=poses, is_path=True))
    halves = model.actual_poses(Motion(poses=(poses[1:] + poses[:-1]) / 2.0, is_path=True))[feeds[1:]]
    off_mm = to_the_path_mm(np.vstack([tool[feeds], halves])[:, :3], path)
    ends = path.poses[(path.kind == RowKind.FEED) & np.append(np.any(path.arc[1:] != path.arc[:-1], axis=1), True)]
    place, missed = 0, []
    for end in ends:
        there = np.flatnonzero(np.linalg.norm(tool[place:, :3] - end[:3], axis=1) < 3e-4)
        missed += [] if len(there) else [end]
        place += int(there[0]) if len(there) else 0
    return off_mm, missed


@pytest.mark.slow
@pytest.mark.parametrize("number", [*BY_DAY, *(pytest.param(number, marks=pytest.mark.nightly) for number in BY_NIGHT)])
def test_a_part_of_a_post_is_read_and_written(number, linuxcnc, crooked, tmp_path):
    post = POSTS[number % len(POSTS)]
    text = program(post, number // len(POSTS))
    they = events(as_linuxcnc_takes_it(text), tmp_path, STORED, TOOLS)
    assert they is not None, f"{post.name}: LinuxCNC refuses\n{text}"
    declared = ControlSetup({"G54": PLACES["G54"]}, LENGTHS) if number // len(POSTS) % 2 else SETUP
    path = linuxcnc.toolpath(text, f"{post.name}.ngc", start=THREE_AXES, setup=declared)
    assert path.is_move.sum() > 20
    known = path.unknown[path.is_move] == 0
    assert known.sum() > 0.8 * len(known)
    written = compensated_program(path, linuxcnc, Inverse(crooked)).text
    done = events(in_inches(written), tmp_path, STORED, TOOLS)
    assert done is not None, f"{post.name}: LinuxCNC refuses what was written\n{written}"
    assert said(moving(done, np.zeros(6))) == said(moving(they, np.zeros(6)))
    off_mm, missed = along(path, done, crooked)
    assert off_mm < 2e-4, f"{post.name}: {off_mm}\n{text}\n{written}"
    assert not missed, f"{post.name}: no move ends at {missed[0]}\n{text}\n{written}"
    # rs274 begins at zero in all axes: our own start is that, too, where both are held against each other.
    begin = np.zeros(6)
    same = linuxcnc.toolpath(text, f"{post.name}.ngc", start=begin, setup=SETUP)
    differs = difference(same, they)
    assert not differs, f"{post.name}: {differs}\n{text}"


NC_FILES = Path("/usr/share/linuxcnc/ncfiles")

REFUSED = (
    r"G38\.\d is not read|G33(\.1)? is not read|G7[0-9.]+ is not read|G[578](\.\d)? (with axes )?is not read"
    r"|the program does not state the place of|is not in this file|runs Python|are not read|is read before|moves nothing|is the control's own|M\d+ is not read"
)


@pytest.mark.slow
@pytest.mark.skipif(not NC_FILES.is_dir(), reason="LinuxCNC's nc_files are not installed")
def test_files_that_come_with_linuxcnc_are_read_as_it_reads_them_or_refused(linuxcnc, tmp_path):
    lengths = dict.fromkeys(range(100), (0.0,) * 6)
    setup = ControlSetup(
        {"G28": (0.0,) * 6, "G30": (0.0,) * 6}, lengths, dict.fromkeys(lengths, 2.54), parameters={1: 0.0}
    )
    table = "".join(f"T{tool} P{tool} D0.1 Z0\n" for tool in lengths)
    equal, refused = [], []
    for file in sorted(NC_FILES.glob("*.ngc")):
        they = events(file.read_bytes(), tmp_path, None, table)
        if they is None or not any(event.kind in MOVES for event in they):
            continue
        text = file.read_bytes().decode("cp1252", "replace")
        try:
            path = linuxcnc.toolpath(text, file.name, start=np.zeros(6), setup=setup)
            if any(event.said.startswith("NURBS_FEED") for event in they):  # without its points
                assert to_the_path_mm(previewed(file), path) < CHORDS_MM
                path = path.only(np.flatnonzero(np.append(path.line[1:] != path.line[:-1], True)))
                curves = [line for line, said in enumerate(text.splitlines(), 1) if said.startswith("G5.1")]
                path = path.only(np.flatnonzero(~np.isin(path.line, curves)))
            differs = difference(path, they)
            equal.append(file.name)
        except InputError as error:
            differs = "" if re.search(REFUSED, str(error)) else str(error)
            refused.append(file.name)
        assert not differs, f"{file.name}: {differs}"
    print(f"{len(equal)} equal: {equal}, {len(refused)} refused: {refused}")  # noqa: T201 - with -s
    assert len(equal) >= 23
