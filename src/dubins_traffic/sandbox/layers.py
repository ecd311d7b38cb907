"""The layers of a box, by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from dubins_traffic.errors import InputError

FILES: Final = "files"
NETWORK: Final = "network"
PIDS: Final = "pids"
IPC: Final = "ipc"
USERS: Final = "users"
SECCOMP: Final = "seccomp"
RLIMITS: Final = "rlimits"
MEMORY: Final = "memory"
PROCESSES: Final = "processes"
CLOCK: Final = "clock"
ENVIRONMENT: Final = "environment"
JUDGE: Final = "judge"
NAMES: Final = {
    FILES: "bubblewrap: it sees files of its own, and the system's read-only",
    NETWORK: "bubblewrap: a network namespace with nothing in it",
    PIDS: "bubblewrap: processes of its own, and a /proc of its own",
    IPC: "bubblewrap: shared memory and queues of its own",
    USERS: "bubblewrap: no user namespace can be made in it",
    SECCOMP: "libseccomp: an allow-list of system calls",
    RLIMITS: "the kernel's limits on each process and user",
    MEMORY: "a control group limits memory",
    PROCESSES: "a control group limits processes",
    CLOCK: "a control group counts processor time",
    ENVIRONMENT: "an environment of its own",
    JUDGE: "this process, which reads what is said and watches what is used",
}
"""What each layer does."""
BOX: Final = (FILES, NETWORK, PIDS, IPC, USERS)
"""The layers that bubblewrap makes."""
INSTALL: Final = "scripts/system-packages.sh, or apt-get install bubblewrap libseccomp2"


@dataclass(frozen=True, slots=True)
class Layers:
    """The layers that a box has. Only a test takes one away from those that hold on a machine."""

    names: frozenset[str] = frozenset(NAMES)
    """Of `NAMES`."""
    why: str = ""
    """Why bubblewrap can't be used, if it can't."""

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def without(self, *names: str) -> Layers:
        """Return the others."""
        return replace(self, names=self.names - set(names))

    @property
    def boxes(self) -> bool:
        """Whether there is a box at all."""
        return FILES in self.names

    def missing(self) -> list[str]:
        """Return what can't be enforced here, as lines for people; a stranger's program is refused then."""
        reasons: list[str] = []
        if not self.boxes:
            reasons.append(f"bubblewrap makes no boxes here: {self.why}")
        if SECCOMP not in self:
            reasons.append("no filter of system calls: libseccomp2 and pyseccomp are needed")
        return reasons

    def require(self) -> None:
        """Refuse a machine on which a stranger's program can't be held.

        Raises
        ------
        InputError
            That says what can't be enforced.
        """
        missing = self.missing()
        if missing:
            raise InputError("; ".join(missing), file="--sandbox", expected=f"{INSTALL}; or --trust-submissions")
