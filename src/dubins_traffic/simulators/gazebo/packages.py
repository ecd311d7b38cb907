"""Debian's packages of Gazebo, fetched by apt and unpacked into a folder, without root and without installing them.

apt works in a folder of its own, with an empty list of installed packages; its mirror and its settings of the
network are those of this machine.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dubins_traffic import files
from dubins_traffic.errors import InputError

SUITE: Final = "bullseye"
"""The release of Debian that has Gazebo 11."""
RUN: Final = ("gazebo", "gazebo-plugin-base")
HEADERS: Final = (
    "libboost1.74-dev",
    "libgazebo-dev",
    "libignition-common-dev",
    "libignition-math-dev",
    "libignition-msgs-dev",
    "libignition-transport-dev",
    "libprotobuf-dev",
    "libsdformat-dev",
    "uuid-dev",
)
"""Packages that the plugin is compiled against; their dependencies are not needed."""
FROM_HOST: Final = ("libc6", "libgcc-s1", "libstdc++6")
"""Packages that are never unpacked: programs use this machine's own."""
WORKERS: Final = 2
PATIENCE: Final = 0.3

Progress = Callable[[str, float], None]
"""Called with a text on what is being done, and the share of it that is done."""


@dataclass(frozen=True, slots=True)
class Package:
    """A package file: its name among apt's archives, and its size in bytes."""

    file: str
    size: int

    @property
    def name(self) -> str:
        """The name of the package."""
        return self.file.partition("_")[0]


class Apt:
    """apt in the folder `home`."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.archives = home / "archives"
        self._settings = home / "apt.conf"

    def prepare(self, progress: Progress) -> None:
        """Fetch the list of the suite's packages from the first of this machine's mirrors that has it.

        Raises
        ------
        InputError
            If none has it.
        """
        for folder in (self.archives / "partial", self.home / "lists" / "partial"):
            folder.mkdir(parents=True, exist_ok=True)
        (self.home / "status").touch()
        files.write_text(self._settings, _settings(self.home))
        said = "no source of packages is set up"
        for k, mirror in enumerate(mirrors()):
            progress(f"list of packages of {SUITE}", 0.1 * k)
            files.write_text(self.home / "sources.list", _source(mirror))
            done = self._apt("update", "--error-on=any")
            if done.returncode == 0:
                progress(f"list of packages of {SUITE}", 1.0)
                return
            said = _last(done.stderr) or _last(done.stdout)
        raise InputError(
            f"no package mirror of this machine gives {SUITE} ({said})",
            file="apt",
            expected=f"a Debian mirror with {SUITE} among apt's sources",
        )

    def wanted(self) -> list[Package]:
        """Return the packages to fetch and unpack, headers last."""
        elsewhere = self.home / "none"  # what is here already would be left out
        (elsewhere / "partial").mkdir(parents=True, exist_ok=True)
        run = self._apt("--print-uris", "-qq", "-o", f"Dir::Cache::archives={elsewhere}", "install", *RUN)
        headers = self._apt("--print-uris", "-qq", "download", *HEADERS)
        for done in (run, headers):
            if done.returncode != 0:
                raise InputError(f"apt can't find Gazebo ({_last(done.stderr)})", file="apt")
        found = re.findall(r"^'[^']+' (\S+) (\d+)", run.stdout + headers.stdout, re.MULTILINE)
        packages = [Package(file, int(size)) for file, size in found]
        return [package for package in packages if package.name not in FROM_HOST]

    def fetch(self, packages: Sequence[Package], progress: Progress) -> None:
        """Download the packages that are missing.

        Raises
        ------
        InputError
            If apt fails; what has arrived is kept.
        """
        total = max(1, sum(package.size for package in packages))
        names = [package.name for package in packages]
        command = [*self._command("-qq", "download"), *names]
        with subprocess.Popen(
            command, cwd=self.archives, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as apt:
            try:
                while apt.poll() is None:
                    time.sleep(PATIENCE)
                    progress("download", min(1.0, _size(self.archives) / total))
            except BaseException:
                apt.terminate()
                raise
            said = apt.stdout.read() if apt.stdout is not None else ""
        if apt.returncode != 0:
            raise InputError(f"apt can't fetch Gazebo ({_last(said)})", file=str(self.archives))
        progress("download", 1.0)

    def unpack(self, packages: Sequence[Package], root: Path, progress: Progress) -> None:
        """Unpack each package below `root` and then remove its file; what was unpacked before is left alone.

        Raises
        ------
        InputError
            If one can't be unpacked, such as for want of room.
        """
        done = self.home / "unpacked"
        done.mkdir(exist_ok=True)
        root.mkdir(exist_ok=True)

        def one(package: Package) -> None:
            archive = self.archives / package.file
            command = ["dpkg-deb", "--extract", str(archive), str(root)]
            result = subprocess.run(command, capture_output=True, text=True, check=False)
            if result.returncode != 0:
                archive.unlink(missing_ok=True)
                raise InputError(f"can't be unpacked ({_last(result.stderr)})", file=str(archive))
            (done / package.file).touch()
            archive.unlink()

        with ThreadPoolExecutor(WORKERS) as pool:
            for k, _ in enumerate(pool.map(one, packages)):
                progress("unpack", (k + 1) / len(packages))

    def left(self, packages: Sequence[Package]) -> list[Package]:
        """Return the packages that have not been unpacked yet."""
        return [package for package in packages if not (self.home / "unpacked" / package.file).exists()]

    def _command(self, *arguments: str) -> list[str]:
        return ["apt-get", "-c", str(self._settings), *arguments]

    def _apt(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self._command(*arguments), capture_output=True, text=True, check=False, env=_plain_language()
        )


def mirrors() -> list[str]:
    """Return the addresses of the package archives that this machine's apt knows, in its order.

    Raises
    ------
    InputError
        If this is no machine with apt.
    """
    for program in ("apt-get", "dpkg-deb"):
        if shutil.which(program) is None:
            raise InputError(
                "Gazebo is installed from Debian's packages, and this machine can't handle them",
                value=f"no {program}",
                expected="Debian or a system made of it, or a gzserver of one's own on the path",
            )
    command = ["apt-get", "--print-uris", "update"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=_plain_language())
    found = re.findall(r"^'([^']+)/dists/[^']+/InRelease'", done.stdout, re.MULTILINE)
    return list(dict.fromkeys(found))


def _settings(home: Path) -> str:
    """Return the settings of apt; hooks of this machine's apt would touch its own folders, and are left out."""
    lines = [
        f'Dir::State "{home}";',
        f'Dir::State::lists "{home}/lists";',
        f'Dir::State::status "{home}/status";',
        f'Dir::Cache "{home}";',
        f'Dir::Cache::archives "{home}/archives";',
        f'Dir::Etc::sourcelist "{home}/sources.list";',
        'Dir::Etc::sourceparts "/dev/null";',
        'Dir::Etc::preferences "/dev/null";',
        'Dir::Etc::preferencesparts "/dev/null";',
        'APT::Install-Recommends "false";',
        'Acquire::Languages "none";',
        'Acquire::Retries "3";',
        'Acquire::Check-Valid-Until "false";',
        "#clear APT::Update::Pre-Invoke;",
        "#clear APT::Update::Post-Invoke;",
        "#clear APT::Update::Post-Invoke-Success;",
    ]
    if os.getuid() == 0:
        lines.append('APT::Sandbox::User "root";')
    return "\n".join(lines) + "\n"


def _source(mirror: str) -> str:
    keys = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
    signed = f" [signed-by={keys}]" if keys.is_file() else ""
    return f"deb{signed} {mirror} {SUITE} main\n"


def _plain_language() -> dict[str, str]:
    return dict(os.environ, LC_ALL="C")


def _size(folder: Path) -> int:
    total = 0
    for file in folder.rglob("*"):
        try:
            total += file.stat().st_size
        except FileNotFoundError:
            continue
    return total


def _last(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:200] if lines else "it said nothing"
