"""`dubins-traffic template`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples("template python my_entry", "template cpp my_entry")


class Language(StrEnum):
    """Languages of which there is a template."""

    PYTHON = "python"
    CPP = "cpp"


def template(
    language: Annotated[
        Language, typer.Argument(metavar="python|cpp", help="Language of the submission.", show_default=False)
    ],
    folder: Annotated[str, typer.Argument(metavar="DIR", help="A folder to make.", show_default=False)],
) -> None:
    """Make a folder with a submission that can be evaluated as it is, to begin from."""
    from dubins_traffic.competition.templates import write_template

    for path in write_template(language.value, Path(folder)):
        options.tell(str(path))
