"""Imports what the commands of tests share, and loads the compiled loops that judge a circle."""

import dbbstation.cli.instruments
import dbbstation.cli.measure
import dbbstation.cli.measure_talk
import dbbstation.cli.on_screen
import dbbstation.demo.loaded
import dbbstation.service.runner
import dbbstation.tui.app  # noqa: F401
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.judged import circles_of_plan
from dbbstation.files.recordings.session import read_session
from dbbstation.station.assembly import check_plan

session = read_session(shipped_folder("fixtures") / "sessions" / "small")
check_plan(session.plan, session.machine, file="plan.yaml")
circles_of_plan(session, None)
