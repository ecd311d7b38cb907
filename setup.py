"""Makes the code of the LCM messages; puts the commit, and the script that fetches Gazebo, into what is built.

All else stands in pyproject.toml.
"""

import runpy
import shutil
import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

NAME = "commit.txt"
HERE = Path(__file__).parent
PACKAGE = Path("src") / "dubins_traffic"
INSTALLER = "gazebo-packages.sh"


def commit() -> str:
    """Return the commit of the checkout, or the one that a source distribution names; empty if there is none."""
    named = HERE / PACKAGE / NAME
    if named.exists():
        return named.read_text(encoding="ascii")
    if not (HERE / ".git").exists():
        return ""
    found = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False
    )
    return found.stdout


class WithCommit(build_py):
    """The modules, and beside them the commit, and the script that fetches Gazebo."""

    def run(self) -> None:
        """Build the modules; an editable installation stays as it is."""
        super().run()
        if not self.editable_mode:
            package = Path(self.build_lib) / "dubins_traffic"
            (package / NAME).write_text(commit(), encoding="ascii")
            shutil.copy(HERE / "scripts" / INSTALLER, package / "simulators" / "gazebo")


class SourcesWithCommit(sdist):
    """The sources, and the commit among them."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Copy the sources."""
        super().make_release_tree(base_dir, files)
        (Path(base_dir) / PACKAGE / NAME).write_text(commit(), encoding="ascii")


runpy.run_path(str(HERE / "scripts" / "lcm_messages.py"))["make"]()
setup(cmdclass={"build_py": WithCommit, "sdist": SourcesWithCommit})
