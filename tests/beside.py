"""Programs that run beside a test."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager


@contextmanager
def running(*command: str, env: Mapping[str, str] | None = None) -> Iterator[subprocess.Popen[str]]:
    """Run a program in an environment, by default the test's; it is gone afterwards, whatever happens."""
    process = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
        process.communicate(timeout=600)


def in_domain(domain: int, *command: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run a program in a DDS domain, with ROS 2's defaults else."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "RMW_"))}
    return running(*command, env=environment | {"ROS_DOMAIN_ID": str(domain)})
