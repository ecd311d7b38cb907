"""`dubins-traffic serve`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import faults, options

EXAMPLES = options.examples(
    "serve season --competition spring",
    "serve season --workers 4 --key-file /etc/season.key",
    "serve season --host 0.0.0.0 --port 8000 --workers 0",
)


WorkersOption = Annotated[
    int, typer.Option("--workers", metavar="N", min=0, help="Workers beside the server, on this machine.")
]
PortOption = Annotated[int, typer.Option("--port", metavar="P", min=0, max=65535, help="Port; 0: any that is free.")]
CompetitionOption = Annotated[
    list[str] | None,
    typer.Option(
        "--competition",
        metavar="PATH",
        help="A competition file, or the folder of one, made unless it is there; may be given several times.",
    ),
]
KeyFileOption = Annotated[
    str | None,
    typer.Option(
        "--key-file",
        metavar="FILE",
        help="Key of secret seeds, outside DIR; drawn if missing.",
        show_default="in your configuration folder",
    ),
]
TrustOption = Annotated[
    bool,
    typer.Option("--trust-submissions", help="Run submissions also where this machine can't enforce every limit."),
]


def serve(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="The folder of the service, made if missing.")],
    workers: WorkersOption = 1,
    host: Annotated[str, typer.Option("--host", metavar="H", help="Address to listen at.")] = "127.0.0.1",
    port: PortOption = 8000,
    competition: CompetitionOption = None,
    key_file: KeyFileOption = None,
    trust: TrustOption = False,
) -> None:
    """Serve competitions on the web: accounts, a queue, workers that judge, tables, replays.

    What it needs to know stands in DIR/service.toml; without one it works on this machine alone. Ctrl-C ends it.
    """
    from dubins_traffic.errors import needs
    from dubins_traffic.live import listening

    with needs("serving competitions", "service"):
        from dubins_traffic.service import logs, serving
        from dubins_traffic.service.service import Service, default_key
        from dubins_traffic.service.worker import check_boxes
    logs.to_stderr()
    if workers:
        check_boxes(trust=trust)
    place = Path(folder)
    key = default_key(place) if key_file is None else Path(key_file)
    known = key.exists()
    service = Service(place, key)
    opened = listening.listen(host, port)
    url = listening.address_of(opened)
    joining = serving.prepare(service, [Path(path) for path in competition or ()], url)
    if not known and key.exists():
        faults.tell(f"{key}: a new key; who loses it has no results: keep a copy elsewhere")
    elif not known:
        faults.tell(f"{key}: no such key; phases with secrets are not judged until it is there")
    print(f"Serving {folder} at {service.settings.url or url}", flush=True)
    if service.settings.url:
        print(f"The proxy finds it at {url}", flush=True)
    if joining is not None:
        print(f"The first organiser joins at {joining}", flush=True)
    worker = (sys.executable, "-m", "dubins_traffic.cli", "worker")
    serving.serve(service, opened, workers, worker, trust=trust)
