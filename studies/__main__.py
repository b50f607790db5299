"""`python -m studies`: reproducible experiments of a checkout."""

from __future__ import annotations

from dbbstation.cli import cli, main
from dbbstation.cli.lazy import LazyGroup
from studies.commands import STUDIES

study = LazyGroup(
    name="python -m studies",
    table=STUDIES,
    package="studies.commands",
    params=cli.params,
    callback=cli.callback,
    context_settings=cli.context_settings,
    help="""Repeat an experiment from a seed to its numbers and its figure.

\b
Examples:
  python -m studies concealed-gravity --figure concealed.svg
  python -m studies coverage --machines 500
  python -m studies table-iii --help
""",
)

if __name__ == "__main__":
    main(group=study)
