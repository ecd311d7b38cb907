"""Makes the code of the LCM messages; puts the commit, the norm, Gazebo's script, and machine code into what is built.

All else stands in pyproject.toml. Machine code lies in the folder that DUBINS_TRAFFIC_MACHINE names, where
`dubins-traffic build --folder` has put it (scripts/release.sh). A wheel with it is one for Linux on x86-64, whichever
Python; without it, one for every machine.
"""

import os
import runpy
import shutil
import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

NAME = "commit.txt"
HERE = Path(__file__).parent
PACKAGE = Path("src") / "dubins_traffic"
INSTALLER = "gazebo-packages.sh"
NORM = Path("docs") / "rules.md"
MACHINE = os.environ.get("DUBINS_TRAFFIC_MACHINE", "")
SYSTEM = "manylinux_2_17_x86_64"
"""Where the libraries run: they need nothing of the system but what fills memory."""


def commit() -> str:
    """Return the commit of the checkout, or the one that a source distribution names; empty if there is none."""
    named = HERE / PACKAGE / NAME
    if named.exists():
        return named.read_text(encoding="ascii")
    if not (HERE / ".git").exists():
        return ""
    found = subprocess.run(["git", "rev-parse", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False)
    return found.stdout


class WithCommit(build_py):
    """The modules, and beside them the commit, the norm, Gazebo's script, and machine code if there is any."""

    def run(self) -> None:
        """Build the modules; an editable installation stays as it is."""
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib) / "dubins_traffic"
        (package / NAME).write_text(commit(), encoding="ascii")
        shutil.copy(HERE / "scripts" / INSTALLER, package / "gazebo")
        shutil.copy(HERE / NORM, package / "rules")
        shutil.rmtree(package / "machine", ignore_errors=True)  # of a wheel that was built here before
        if MACHINE:
            shutil.copytree(MACHINE, package / "machine")


class ForMachine(bdist_wheel):
    """A wheel, named after the machines that it is for."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags of the wheel."""
        return ("py3", "none", SYSTEM) if MACHINE else super().get_tag()


class SourcesWithCommit(sdist):
    """The sources, and the commit among them."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Copy the sources."""
        super().make_release_tree(base_dir, files)
        (Path(base_dir) / PACKAGE / NAME).write_text(commit(), encoding="ascii")


runpy.run_path(str(HERE / "scripts" / "lcm_messages.py"))["make"]()
setup(cmdclass={"bdist_wheel": ForMachine, "build_py": WithCommit, "sdist": SourcesWithCommit})
