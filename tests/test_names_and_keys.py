"""A name has one class, and results have fields: counted in the source, so that neither gets worse unnoticed.

    python -m tests.test_names_and_keys

prints the counts.
"""

from __future__ import annotations

import ast
import sys
from collections import defaultdict

from tests.parsed import PACKAGE, trees_with

MOST_LOOSE_FILES = 5
"""Files that stand in no folder of the package."""

MOST_ANONYMOUS_DICTIONARIES = 12
"""How often `dict[str, Any]` is written: dictionaries of which nobody says what is in them. JSON Schemas, results as plain objects, and
keyword arguments of Matplotlib are left."""

MOST_SUBSCRIPTS = 8
"""How often the command line takes a value by a key that is written out, where a typed result would have a field."""


def public_classes(trees):
    found = defaultdict(list)
    for path, tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path)
    return found


def is_anonymous_dictionary(node):
    named = isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "dict"
    return named and ast.unparse(node) == "dict[str, Any]"


def is_key(node):
    return (
        isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str)
    )


def count(trees, is_one, folder=""):
    return sum(is_one(node) for path, tree in trees if path.startswith(folder) for node in ast.walk(tree))


def shared_names():
    return {name: files for name, files in public_classes(trees_with({"class"})).items() if len(files) > 1}


def anonymous_dictionaries():
    return count(trees_with({"Any"}), is_anonymous_dictionary)


def keys_in_the_command_line():
    return count(trees_with(None, "cli"), is_key)


def loose_files():
    return len(list(PACKAGE.glob("*.py")))


def test_no_two_public_classes_have_one_name():
    assert shared_names() == {}


def test_loose_files_do_not_become_more():
    assert loose_files() <= MOST_LOOSE_FILES


def test_dictionaries_of_anything_do_not_become_more():
    assert anonymous_dictionaries() <= MOST_ANONYMOUS_DICTIONARIES


def test_keys_in_the_command_line_do_not_become_more():
    assert keys_in_the_command_line() <= MOST_SUBSCRIPTS


def test_counts_find_what_they_look_for():
    tree = [("cli/a.py", ast.parse("class A: ...\nclass A: ...\nx: dict[str, Any] = y['key']\n"))]
    assert public_classes(tree)["A"] == ["cli/a.py", "cli/a.py"]
    assert (count(tree, is_anonymous_dictionary), count(tree, is_key, "cli"), count(tree, is_key, "nc")) == (1, 1, 0)


def starts_the_command_line(tree):
    """Whether a process of the command line is begun: `python -m dbbstation`, `python_module("dbbstation")` or `copies("dbbstation", …)`."""
    nodes = list(ast.walk(tree))
    lists = [node.elts for node in nodes if isinstance(node, ast.List | ast.Tuple)]
    calls = [
        node.args
        for node in nodes
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in {"python_module", "copies"}
    ]
    words = [{one.value for one in found if isinstance(one, ast.Constant)} for found in lists]
    return any(one >= {"-m", "dbbstation"} for one in words) or any(
        isinstance(one, ast.Constant) and one.value == "dbbstation" for found in calls for one in found
    )


def test_nobody_but_the_demonstration_starts_the_command_line():
    may = trees_with({"m", "python_module", "copies"})
    assert [path for path, tree in may if starts_the_command_line(tree)] == ["demo/whole_job.py"]


def counts():
    return {
        "public classes with a name that another has": len(shared_names()),
        "dict[str, Any]": anonymous_dictionaries(),
        "subscripts by a string in cli": keys_in_the_command_line(),
        "files at the root of the package": loose_files(),
    }


if __name__ == "__main__":
    sys.stdout.writelines(f"{what}: {number}\n" for what, number in counts().items())
