"""`dubins-traffic explain`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples("explain 3.stop", "explain E4", "explain")
WIDTH = 80


def explain(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[RULE]", help="What a breach or a message names, such as 3.stop.", show_default=False),
    ] = None,
) -> None:
    """Say what a rule means: in plain words, and as the norm has it. Without a name: all rules in a line each."""
    import textwrap

    from dubins_traffic.release import homepage
    from dubins_traffic.rules.explained import MEANINGS, explained

    if name is None:
        width = max(map(len, MEANINGS))
        for rule, meaning in sorted(MEANINGS.items()):
            lines = textwrap.wrap(meaning, WIDTH - width - 2)
            print(f"{rule:{width}}  {lines[0]}", *(f"{'':{width}}  {line}" for line in lines[1:]), sep="\n")
        return
    clause = explained(name)
    if clause.meaning:
        print(textwrap.fill(f"{name}: {clause.meaning}", WIDTH), end="\n\n")
    first, *below = clause.norm
    print(textwrap.fill(f"The norm: {first}", WIDTH))
    for text in below:
        print(textwrap.fill(text, WIDTH, initial_indent="- ", subsequent_indent="  "))
    print()
    print(f"All rules and all pages: {homepage()}")
