"""`dubins-traffic worker`."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "worker https://compete.example.org --token-file worker.token",
    "worker https://compete.example.org --token-file worker.token --ray 10.0.0.1:6379 --workers 16",
)


TokenFileOption = Annotated[
    str | None,
    typer.Option(
        "--token-file",
        metavar="FILE",
        help="The token that the organiser's desk gave for this worker.",
        show_default="DUBINS_TRAFFIC_TOKEN of the environment",
    ),
]
NameOption = Annotated[
    str | None,
    typer.Option("--name", metavar="NAME", help="What the service calls it.", show_default="this machine's"),
]
FolderOption = Annotated[
    str | None,
    typer.Option("--folder", metavar="DIR", help="For submissions, unpacked.", show_default="in your cache folder"),
]
TrustOption = Annotated[
    bool,
    typer.Option("--trust-submissions", help="Run submissions also where this machine can't enforce every limit."),
]
RayOption = Annotated[
    str | None,
    typer.Option(
        "--ray",
        metavar="ADDRESS",
        help="Be carried by a Ray cluster: host:port, ray://host:port, auto, or local for one of its own.",
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        min=1,
        help="Workers on the Ray cluster.",
        show_default="one for each of its processors",
    ),
]


def worker(
    url: Annotated[str, typer.Argument(metavar="URL", help="Address of the service.")],
    token_file: TokenFileOption = None,
    name: NameOption = None,
    folder: FolderOption = None,
    trust: TrustOption = False,
    ray: RayOption = None,
    workers: WorkersOption = None,
    with_parent: Annotated[bool, typer.Option("--with-parent", hidden=True)] = False,
) -> None:
    """Judge trials for a service, which may be on another machine; start as many as there are cores to spare.

    With --ray they run on the nodes of a cluster, and one that is lost there is replaced. What is at work when it is
    told to end is given back. It gives way to other programs of the machine.
    """
    from dubins_traffic.errors import needs

    with needs("a worker", "service"):
        from dubins_traffic.service import logs
        from dubins_traffic.service import worker as room
        from dubins_traffic.service.client import Connection, token_from
    logs.to_stderr()
    called, token = name or socket.gethostname()[:60], token_from(token_file)
    if ray is not None:
        from dubins_traffic.service.ray_workers import Carrier, Task

        Carrier(ray, Task(url, token, called, folder, trust), workers).carry()
        return
    if workers is not None:
        raise InputError("only a cluster has a number of workers", file="--workers", expected="--ray ADDRESS")
    place = room.default_folder() if folder is None else Path(folder)
    made = room.Worker(Connection(url, token), called, place, trust=trust)
    room.until_signalled(made, with_parent=with_parent)
