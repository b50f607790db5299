"""`dbbstation settings shipped`: plans, machines, jigs, a session and examples that come with the program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.errors import StationError
from dbbstation.files.gateway import content_of
from dbbstation.files.places import shipped_folder
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option
from dbbstation.text.written import on_one_line, words

_FIXTURES = words(
    "bars, cmm, drives, foreign, gauges, jigs, jobs, machines, mappings, models, nc, settings, simulators, "
    "sources, tables"
)
_SESSION = "sessions/small"

EXAMPLES = {
    **{
        f"{name}/": _SESSION
        for name in words(
            "2026-11-20-hexapod-7, session, sessions/monday, monday, tuesday, measured, check-session, "
            "recorded-elsewhere, standard-test, before, after, verified, hall-1/monday, hall-2/tuesday"
        )
    },
    **{
        name: f"tables/{name}"
        for name in ("arm.csv", "axis.csv", "commanded.csv", "excel.csv", "poses.csv", "tank.csv")
    },
    **{name: f"nc/{name}" for name in ("block.ngc", "linuxcnc.var", "part.ngc", "tool.tbl")},
    **{f"pendulum.{kind}": f"simulators/pendulum.{kind}" for kind in ("csv", "py", "yaml")},
    **{f"old/{name}": f"foreign/{name}" for name in ("a_links.csv", "a_rechts.csv")},
    "a.csv": "foreign/a_links.csv",
    "old-program.yaml": "mappings/every-key.yaml",
    "bar.yaml": "bars/zerodur.yaml",
    "cmm.csv": "cmm/plate.csv",
    "plate.dmo": "cmm/plate.dmo",
    "mountings.csv": "cmm/mountings.csv",
    "machine.yaml": "machines/reference.yaml",
    "measured.yaml": "machines/every-key.yaml",
    "model.yaml": "models/small.yaml",
    "my-gauge.yaml": "gauges/my-gauge.yaml",
    "plan.yaml": "plans/ten-minute-check.yaml",
    "plate.yaml": "jigs/reference-plate.yaml",
    "scale_bow.py": "sources/scale_bow.py",
    "fast.csv": "drives/strut.csv",
    "slow.csv": "drives/strut.csv",
    "strut3.csv": "drives/strut.csv",
    "table2.yaml": "plans/table2.yaml",
}
"""Names that help texts use, and the files that `examples` has for them; a name that ends with a slash is a folder."""


@made()
def shipped(
    name: Annotated[str | None, Option("what is copied.", kind="argument-text", metavar="[NAME]")] = None,
    *,
    out: Annotated[Path | None, Option("Copy NAME into this folder.", kind="folder")] = None,
    force: o.Force = False,
) -> Answer:
    r"""List or copy the plans, machines, jigs, small session and examples that come with the program.

    NAME is one of these, or a kind such as `plans`. `examples` contains the files that help texts name.

    \b
    Examples:
      dbbstation settings shipped
      dbbstation settings shipped plans/table2.yaml --out .
      dbbstation settings shipped examples --out try
    """
    from dbbstation.catalogue import nearest
    from dbbstation.files.atomic import write_folder

    files = shipped_files()
    if (name is None) != (out is None):
        raise click.UsageError("give NAME, which is copied, and --out, the folder for the copy")
    if name is None or out is None:
        names = [*(key for key in files if not key.startswith(f"{_SESSION}/")), _SESSION, "examples"]
        return Answer({"shipped": names}, names)
    wanted = name.rstrip("/")
    chosen = (
        _examples(files)
        if wanted == "examples"
        else {
            key.removeprefix(wanted).lstrip("/") or Path(key).name: path
            for key, path in files.items()
            if key == wanted or key.startswith(f"{wanted}/")
        }
    )
    if not chosen:
        kinds = ["examples", *dict.fromkeys(key.partition("/")[0] for key in files)]
        raise StationError(f"no shipped file is called {name!r}", remedy=nearest(name, kinds))
    write_folder(out, {key: content_of(path) for key, path in chosen.items()}, force=force)
    return Answer({"shipped": sorted(chosen)}, [on_one_line(f"{len(chosen)} files written to {out}")])


def shipped_files() -> dict[str, Path]:
    """Return all files that come along, by kind and name with a slash between."""
    fixtures, protocols = shipped_folder("fixtures"), shipped_folder("protocols")
    folders = [(kind, fixtures / kind) for kind in (*_FIXTURES, _SESSION)]
    folders += [(kind, protocols / kind) for kind in ("plans", "instruments")]
    found = {
        f"{kind}/{path.relative_to(folder).as_posix()}": path
        for kind, folder in folders
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    return dict(sorted(found.items()))


def _examples(files: dict[str, Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for name, source in EXAMPLES.items():
        if name.endswith("/"):
            found |= {
                name + key.removeprefix(f"{source}/"): path
                for key, path in files.items()
                if key.startswith(f"{source}/")
            }
        else:
            found[name] = files[source]
    return found
