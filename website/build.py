"""Builds the site of the documentation: ``python website/build.py [FOLDER]``, needs the extra ``docs``.

The pages are gathered from `docs/`, README and the code, and Sphinx makes FOLDER (``build/site``) of them. Warnings are
errors. No page asks anything of another host.
"""

from __future__ import annotations

import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from tempfile import TemporaryDirectory

from api import write_api
from command_line import write_command_line
from gallery import write_gallery
from pages import ROOT, gather
from results import put_on_front, write_results


def main() -> int:
    """Gather the sources, and build the site of them.

    Returns
    -------
    int
        The exit status: 0 if there was no warning.
    """
    parser = ArgumentParser(description="Build the site of the documentation; warnings are errors.")
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "build" / "site", help="where to put it")
    folder = parser.parse_args().folder
    with TemporaryDirectory() as given:
        source, extra = Path(given) / "source", Path(given) / "extra"
        gather(source)
        write_api(source / "reference" / "api")
        write_command_line(source / "reference" / "command-line.md")
        write_gallery(source / "gallery.md", extra / "gallery")
        write_results(source / "results.md", extra / "results")
        put_on_front(source / "index.md")
        return _build(source, extra, folder, Path(given) / "doctrees")


def _build(source: Path, extra: Path, folder: Path, trees: Path) -> int:
    sphinx = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-b", "html"]
    places = ["-c", Path(__file__).parent, "-d", trees, "-D", f"html_extra_path={extra}", source, folder]
    return subprocess.run([*sphinx, *places], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
