"""What a release says of itself agrees: version, changes, citation, licences, and the lock with what is declared."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

import releasing

ROOT = Path(__file__).parents[1]
PARTS = re.split(r"(?m)^(?=[a-z0-9])", (ROOT / "requirements.lock").read_text(encoding="utf-8"))[1:]
LOCKED: dict[str, list[Version]] = {}
for _part in PARTS:
    _name, _, _rest = _part.partition("==")
    LOCKED.setdefault(_name, []).append(Version(_rest.split()[0]))  # several where interpreters need others


# `small` takes an older compiler than the lock; `releasing.py try --lowest` installs it.
@pytest.mark.parametrize("extra", ["", *sorted(set(releasing.PROJECT["optional-dependencies"]) - {"small"})])
def test_the_lock_has_every_declared_package_within_its_bounds(extra):
    extras = releasing.PROJECT["optional-dependencies"]
    for text in extras[extra] if extra else releasing.PROJECT["dependencies"]:
        one = Requirement(text)
        locked = LOCKED[re.sub(r"[-_.]+", "-", one.name).lower()]
        assert all(version in one.specifier for version in locked), text


def test_every_locked_package_has_hashes_and_no_address():
    assert all("--hash=sha256:" in part and "://" not in part for part in PARTS)


def test_every_package_that_comes_along_has_a_licence():
    rows = re.findall(r"(?m)^\| ([\w.-]+) \| (.*) \|$", (ROOT / "THIRD-PARTY.md").read_text(encoding="utf-8"))[1:]
    names = {Requirement(text).name.lower() for text in releasing.PROJECT["dependencies"]}
    assert {name.lower() for name, _ in rows} >= names
    assert all(len(licence) > 2 for _, licence in rows)


def test_a_release_that_disagrees_with_itself_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(releasing, "VERSION", "9.9.9")
    monkeypatch.setattr(releasing, "LARGEST_MB", {".whl": 1e-6})
    wheel = tmp_path / "dbbstation-9.9.9-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("tests/x.py", "")
    found = "\n".join(releasing.faults_of([wheel]))
    for fault in (
        "dbbstation/py.typed is not in the wheel",
        "tests/x.py is in the wheel",
        "CHANGELOG.md does not begin with 9.9.9",
        "CITATION.cff is not of 9.9.9",
        "0.0 MB",
    ):
        assert fault in found
