"""Names that one kind of system has stand in one folder: the imports are held by a contract, their use here."""

from __future__ import annotations

import ast
import importlib

from tests.parsed import trees_with
from tests.system.windows.sitecustomize import declared

MODULES = ("os", "select", "signal", "subprocess", "time")


def names_used(tree: ast.AST, names: frozenset[str]) -> list[tuple[int, str]]:
    return [
        (node.lineno, f"{node.value.id}.{node.attr}")
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and f"{node.value.id}.{node.attr}" in names
    ]


def only_there() -> frozenset[str]:
    """What typeshed declares for Linux and not for Windows, and flags of `os.open`, which mean another thing on each."""
    gone = {f"{name}.{one}" for name in MODULES for one in declared(name, "linux") - declared(name, "win32")}
    flags = {f"os.{one}" for one in dir(importlib.import_module("os")) if one.startswith("O_")}
    return frozenset(gone | flags)


def test_no_other_folder_uses_names_that_windows_lacks():
    names = only_there()
    assert {"os.pread", "os.O_CLOEXEC", "select.poll", "signal.SIGHUP"} <= names
    assert "os.replace" not in names
    assert names_used(ast.parse("os.pread(h, 1, 2)"), names) == [(1, "os.pread")]
    found = {
        path: used
        for path, tree in trees_with({name.partition(".")[2] for name in names})
        if not path.startswith("system/") and (used := names_used(tree, names))
    }
    assert found == {}
