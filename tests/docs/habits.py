"""How often the ten habits that make sentences hard to read occur in documents, help and messages.

`python -m tests.docs.habits` prints their shares; `--store` keeps them as limits, `--show HABIT` lists the sentences. Patterns find likely
cases, not certain ones: "it says" of a person counts too. So a share is a help for whoever writes and no measure of quality.
`--sample 100 --seed 1` draws sentences for a reader, docstrings among them.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli import cli
from studies.__main__ import study

if TYPE_CHECKING:
    from collections.abc import Iterator

HERE = Path(__file__).resolve().parents[2]
LIMITS = Path(__file__).with_name("habits.json")

MOST_WORDS = 30
"""Words of a sentence that is still read at once; two lines of a page."""

MARKS = re.compile(r"[;:](?=\s|$)")
CODE = re.compile(r"`[^`]*`")
PATTERNS = {
    "what-clause as subject": r"^(what|whoever|who)\b(?!.*\?$)",
    "things that stand, say, know": r"\b(stands?|lies|speaks?|says?|knows?|asks|(is|are) (told|asked))\b",
    "private words": r"\b(seat|the rest|a look|bank|story|what is left|beginnings|strange|twin|reckoned)\b",
    "none, nobody, nothing": r"\b(none|nobody|nothing)\b|\bis no\b(?! longer)",
    "those of, that of": r"\b(those of|that of|of its own|of that)\b",
    "where for if": r"\bwhere\b(?!.*\?$)",
    "opening without a noun": r"^(that|those|it|one|this)\b",
    "inverted opening": r"^(of (the|all|its|these|those)\b|so (is|are|was|does|do)\b|nor\b|neither\b|only then\b|beside (it|them|that)\b)",
}
LONG, MANY_MARKS = "over 30 words", "two semicolons or colons"
HABITS = [*PATTERNS, LONG, MANY_MARKS]


def habits_of(sentence: str) -> list[str]:
    sentence = CODE.sub("code", sentence)
    found = [name for name, pattern in PATTERNS.items() if re.search(pattern, sentence, re.IGNORECASE)]
    if len(sentence.split()) > MOST_WORDS:
        found.append(LONG)
    if len(MARKS.findall(sentence)) > 1:
        found.append(MANY_MARKS)
    return found


def sentences_of(text: str) -> list[str]:
    """Return the sentences of plain text: five words at least beside code, links made plain."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"[*{}]|(?<!\w)_|_(?!\w)|\b(e\.g|i\.e|cf|sec|eq)\. ", " ", text)
    found = re.split(r"(?<=[.!?])\s+(?=[A-Z\"(0-9])", " ".join(text.split()))
    return [one for one in found if len(re.findall(r"[a-zA-Z]{2,}", CODE.sub("code", one))) > 4]


def in_documents(root: Path) -> Iterator[str]:
    """Yield sentences of guides: paragraphs and list items, no blocks, tables and headings."""
    for path in [
        *sorted((root / "docs").rglob("*.md")),
        root / "README.md",
        root / "CONTRIBUTING.md",
        root / "CHANGELOG.md",
    ]:
        if "_generated" in path.parts or "_build" in path.parts:
            continue
        prose = re.sub(r"^\s*```.*?^\s*```", "\n", path.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
        prose = re.sub(r"^(\s*\||#|    \S).*$", "\n", prose, flags=re.MULTILINE)
        for block in re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.)\s", prose):
            yield from sentences_of(block)


def in_help(group: click.Group = cli) -> Iterator[str]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None:
            continue
        head = (command.help or "").partition("\b\nExamples")[0]
        yield from sentences_of(re.sub(r"[.]?\s*\n\s*\n", ". ", head))
        for option in command.params:
            yield from sentences_of(getattr(option, "help", None) or "")
        if isinstance(command, click.Group):
            yield from in_help(command)


def in_messages(root: Path) -> Iterator[str]:
    """Yield sentences of errors and notes: of what is raised, of problems, of rules, and of what is said or printed."""
    for path in sorted((root / "dbbstation").rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
        calls = [node for node in nodes if isinstance(node, ast.Call)]
        rules = {"_rules", *(_value(node.args[0]) for node in calls if _name(node) == "sound")}
        for node in nodes:
            if (
                isinstance(node, ast.Raise)
                or (isinstance(node, ast.Call) and _name(node) in {"say", "echo", "Problem", "of", "add"})
                or (isinstance(node, ast.FunctionDef) and node.name in rules)
            ):
                for text in _texts(node):
                    yield from sentences_of(text)


def in_docstrings(root: Path) -> Iterator[str]:
    """Yield sentences of docstrings, without the lists of arguments and attributes."""
    for path in sorted((root / "dbbstation").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                prose = re.split(r"^(?:Args|Attributes|Raises):$", ast.get_docstring(node) or "", flags=re.MULTILINE)[0]
                for block in prose.split("\n\n"):
                    yield from sentences_of(block)


def sample(root: Path, count: int, seed: int) -> Iterator[str]:
    """Yield as many sentences of each kind, drawn without regard to their number."""
    every = {**kinds(root), "docstrings": list(in_docstrings(root))}
    drawn = random.Random(seed)  # noqa: S311 - not for secrets
    for number in range(count):
        kind = list(every)[number % len(every)]
        yield f"{kind}: {drawn.choice(every[kind])}"


def _name(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")


def _texts(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.JoinedStr):
        yield "".join(
            str(one.value) if isinstance(one, ast.Constant) else f"`{_value(one)}`" for one in node.values
        ).replace("``", "`")
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from _texts(child)


def _value(part: ast.AST) -> str:
    """Return a value of a message as its code has it, so that a reader knows what is put there."""
    return ast.unparse(part.value if isinstance(part, ast.FormattedValue) else part).replace("`", "'")


def kinds(root: Path = HERE) -> dict[str, list[str]]:
    return {
        "documents": list(in_documents(root)),
        "help": [*in_help(), *in_help(study)],
        "messages": list(in_messages(root)),
    }


def shares(sentences: list[str]) -> dict[str, float]:
    found = [habits_of(one) for one in sentences]
    return {habit: round(100 * sum(habit in one for one in found) / max(len(found), 1), 2) for habit in HABITS}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=HERE, help="checkout to read")
    parser.add_argument("--show", metavar="HABIT", choices=HABITS, help="list the sentences with this habit")
    parser.add_argument("--sample", type=int, metavar="N", help="draw sentences for a reader")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--store", action="store_true", help="keep the shares as limits of the test")
    given = parser.parse_args()
    if given.sample:
        for number, one in enumerate(sample(given.root, given.sample, given.seed), 1):
            click.echo(f"{number}. {one}")
        return
    found = kinds(given.root)
    if given.show:
        for kind, sentences in found.items():
            for one in sentences:
                if given.show in habits_of(one):
                    click.echo(f"{kind}: {one}")
        return
    table = {kind: shares(sentences) for kind, sentences in found.items()}
    click.echo(f"{'share of sentences [%]':<30}" + "".join(f"{kind:>11}" for kind in table))
    for habit in HABITS:
        click.echo(f"{habit:<30}" + "".join(f"{table[kind][habit]:11.1f}" for kind in table))
    click.echo(f"{'sentences':<30}" + "".join(f"{len(found[kind]):11d}" for kind in table))
    if given.store:
        LIMITS.write_text(json.dumps(table, indent=2) + "\n", "utf-8")


if __name__ == "__main__":
    main()
