"""What is begun, typed or changed before a block of a page: sessions, a service, a world of cars, another's answers."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from zipfile import ZipFile

from dubins_traffic.competition.templates import write_template
from tests.beside import running
from tests.ports import kept_domain, kept_port
from tests.reader import Reader
from tests.ros import CARS, ROOT, graph
from tests.services import serving
from tests.shown import Block
from tests.shown_files import DRIVER
from tests.tools import interpreter_with


def beside(code: str, until: str) -> Callable[[Reader], None]:
    """Return what begins a command beside what follows."""
    block = Block("sh", code, 0, f"beside; until {until}")
    return lambda reader: reader.follow(block)


def typed(code: str) -> Callable[[Reader], None]:
    """Return what types something into the shell."""
    return lambda reader: reader.follow(Block("sh", code, 0, ""))


def own_ports() -> dict[str, str]:
    master = kept_port()
    return {
        "7411": str(kept_port()),
        "11311": str(master),
        "--master ": f"--master --port {master} ",
        ":7667": f":{lcm_port()}",
    }


@cache
def lcm_port() -> int:
    return kept_port()


@cache
def own_domain() -> int:
    return kept_domain()


def own_graphs() -> dict[str, str]:
    return {
        "ROS_DOMAIN_ID": str(own_domain()),
        "ROS_IP": "127.0.0.1",
        "LCM_DEFAULT_URL": f"udpm://239.255.76.67:{lcm_port()}?ttl=0",
    }


def competition_of(folder: Path, name: str) -> None:
    """Make a competition of one short trial in each phase."""
    write_template("competition", folder / name)
    fewer(folder / name / "competition.toml")


def fewer(path: Path) -> None:
    path.write_text(re.sub(r"trials = \d+", "trials = 1", path.read_text()))


def shorter(reader: Reader) -> None:
    fewer(reader.folder / "spring" / "competition.toml")


def closed(reader: Reader) -> None:
    """Let the dates of all phases lie in the past."""
    path = reader.folder / "spring" / "competition.toml"
    path.write_text(re.sub(r"= 20\d\d-", "= 2020-", path.read_text()))


def published(reader: Reader) -> None:
    """Type the commitment that was published."""
    reader.replaced["5f2c..."] = hashlib.sha256(
        (reader.folder / "spring" / "published" / "test.seeds.txt").read_bytes()
    ).hexdigest()


def handed_in(reader: Reader) -> None:
    """Serve the competition, with a team whose token lies in `token` and in the variable."""
    service = reader.stack.enter_context(
        serving(reader.folder / "season", "--competition", str(reader.folder / "spring"))
    )
    member = service.person().join(service.organiser().invite(), "Ann", "Ants").with_token()
    (reader.folder / "token").write_text(member.token)
    reader.replaced |= {
        "https://compete.example.org": service.url,
        "DUBINS_TRAFFIC_TOKEN=...": f"DUBINS_TRAFFIC_TOKEN={member.token}",
    }


def world_of_cars(reader: Reader) -> None:
    """Let cars be somewhere else, on a ROS graph of this test."""
    ros = reader.stack.enter_context(graph(reader.notes))
    reader.around |= {name: ros.environment[name] for name in ros.environment if name.startswith("ROS_")}
    ros.world()


def world_of_cars_over_ros2(reader: Reader) -> None:
    """Let cars be somewhere else, in the domain of the page."""
    world = (interpreter_with("jazzy"), str(ROOT / "tests" / "ros2_world.py"), "none", *CARS)
    reader.stack.enter_context(running(*world, env=reader.around))


def program(folder: Path) -> None:
    """Make a program that speaks JSON lines."""
    path = folder / "drive"
    path.write_text(
        "#!/usr/bin/python3\nimport json\nimport sys\nfor line in sys.stdin:\n    said = json.loads(line)\n"
        "    if 'frame' in said:\n"
        "        print(json.dumps({'command': [0.1, 0.0], 'tick': said['frame']['tick']}), flush=True)\n"
    )
    path.chmod(0o755)


def started_over_ros2(reader: Reader) -> None:
    """Begin a session over DDS, and what asks it for READY and START and drives nothing."""
    beside("dubins-traffic ros2 run demo --records smallest-ros2", "waiting for READY")(reader)
    asking = "from controller import Controller; Controller.drive = lambda *_: None; Controller().spin()"
    reader.follow(Block("sh", f"PYTHONPATH=examples/ros2:${{PYTHONPATH:-}} python -c '{asking}'\n", 0, "beside; ended"))


def entries(folder: Path) -> None:
    """Make the entries of Ada and Bob, archives of one file."""
    (folder / "entries").mkdir()
    for name, speed in (("ada", 0.1), ("bob", 0.0)):
        with ZipFile(folder / "entries" / f"{name}.zip", "w") as archive:
            archive.writestr("controller.py", DRIVER.format("Controller").replace("0.1, 0.0", f"{speed}, 0.0"))
