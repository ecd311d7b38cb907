"""What each page takes for granted: files that it names, what must be installed, what is begun before a block."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files as files_of
from json import dumps, loads
from pathlib import Path

import dubins_traffic as dt
from tests.foreign import ROAD, as_tulip
from tests.reader import Reader
from tests.ros import need_ros
from tests.shown_beside import (
    beside,
    closed,
    competition_of,
    entries,
    handed_in,
    own_graphs,
    own_ports,
    program,
    published,
    shorter,
    started_over_ros2,
    typed,
    world_of_cars,
    world_of_cars_over_ros2,
)
from tests.shown_files import (
    DRIVER,
    FLOOR,
    SQUARE,
    clone,
    file_of,
    files,
    need_boxes,
    need_gazebo,
    need_sumo,
    recorded,
    short_demo,
    towns,
)


@dataclass(frozen=True)
class Page:
    """What a page takes for granted.

    Parameters
    ----------
    there : tuple of callables
        They put files into the folder in which the page is followed.
    needs : tuple of callables
        They skip the test where something is not installed.
    replaced : callable
        Returns what is typed instead of what stands there: ports of this test's own, fewer trials.
    environment : callable
        Returns variables.
    before : mapping of str to callable
        What happens before the block that holds a text.
    with_pages : tuple of str
        Pages that are followed before, in the same folder.
    elsewhere : frozenset of str
        Languages whose blocks another test runs.
    """

    there: tuple[Callable[[Path], None], ...] = ()
    needs: tuple[Callable[[], None], ...] = ()
    replaced: Callable[[], Mapping[str, str]] = dict
    environment: Callable[[], Mapping[str, str]] = dict
    before: Mapping[str, Callable[[Reader], None]] = field(default_factory=dict)
    with_pages: tuple[str, ...] = ()
    elsewhere: frozenset[str] = frozenset()


GAPS = 'version = 0\ntrials = 2\ncontrollers = ["lanes", "simple"]\nconfigurations = ["demo"]\n'
OLD = dumps({**SQUARE, "rules": {"edition": 2}})
MISSPELT = dumps({**SQUARE, "formulas": {"soon back": "[] (lefd_ego -> <>[0,4] !lefd_ego)"}})
FEW = dumps(
    {
        "version": 0,
        "name": "few",
        "title": "A trial of a square",
        "metric": "counted_rounds",
        "campaign": {
            "version": 0,
            "seed": 1,
            "trials": 1,
            "controllers": ["rules"],
            "configurations": [{"name": "square", "document": {**SQUARE, "duration": 5}}],
        },
    }
)
GAMES = loads((files_of("dubins_traffic.suites") / "data" / "synthesis-2026.json").read_text(encoding="utf-8"))
ONE_GAME = dumps({**GAMES, "name": "one", "games": GAMES["games"][:1]})

PAGES: dict[str, Page] = {
    "attach.md": Page(
        there=(short_demo, clone("examples", "scripts")),
        needs=(need_ros,),
        replaced=own_ports,
        environment=own_graphs,
        before={
            "/usr/bin/python3 smallest.py": beside(
                "dubins-traffic ros1 run demo --master --records smallest-ros", "waiting for READY"
            ),
            "from lcm import LCM": beside("dubins-traffic lcm run demo --lockstep --records smallest-lcm", "begins"),
            "from dubins_traffic.transports.ros2 import": started_over_ros2,
        },
    ),
    "campaigns.md": Page(
        there=(
            short_demo,
            files(gaps__toml=GAPS, my_controller__py=DRIVER.format("Mine"), small__json=dumps(SQUARE)),
        )
    ),
    "competitions/file.md": Page(
        there=(entries,),
        needs=(need_boxes,),
        replaced=lambda: {"~/": "../", "/s/7": "/s/1"},
        before={
            "competition check spring": shorter,
            "competition reveal": closed,
            "--commitment": published,
            "pip install 'dubins-traffic[client]'": handed_in,
        },
        with_pages=("competitions/organisers.md", "competitions/participants.md"),
    ),
    "extending/car-model.md": Page(there=(clone("examples"),)),
    "extending/e-agent.md": Page(),
    "extending/map-format.md": Page(there=(clone("examples"),)),
    "extending/metric.md": Page(
        there=(clone("examples"), recorded("demo"), file_of("examples/extending/my_metric.py")),
    ),
    "extending/simulator.md": Page(there=(recorded("demo"), file_of("examples/extending/my_simulator.py"))),
    "extending/transport.md": Page(),
    "external-worlds.md": Page(
        there=(files(floor__json=dumps(FLOOR)),),
        needs=(need_ros,),
        before={"--records out": world_of_cars, "ros2-world": world_of_cars_over_ros2},
    ),
    "falsify.md": Page(),
    "foreign-strategies.md": Page(
        there=(
            files(
                square__json=dumps(ROAD),
                solve__py=f"import sys\nopen(sys.argv[2], 'w').write({as_tulip()!r})\n",
            ),
        ),
    ),
    "gazebo.md": Page(
        there=(short_demo, lambda folder: dt.RoadNetwork.grid(2, 2, length=3.0).write(folder / "town.json")),
        needs=(need_gazebo,),
    ),
    "learning.md": Page(there=(clone("examples"),)),
    "maps.md": Page(
        needs=(need_sumo,),
        there=(
            clone("examples/maps"),
            lambda folder: shutil.copy(towns() / "DRT" / "osm.net.xml", folder / "town.net.xml"),
            lambda folder: shutil.copy(towns() / "bs3d" / "bs.net.xml", folder / "bs3d.net.xml"),
        ),
    ),
    "package.md": Page(),
    "records.md": Page(there=(recorded("town", 7),)),
    "sandbox.md": Page(
        there=(short_demo, clone("scripts"), files(theirs__py=DRIVER.format("Driver")), program),
        needs=(need_boxes,),
    ),
    "shield.md": Page(there=(files(my_controller__py=DRIVER.format("MyController")),)),
    "stability.md": Page(),
    "suites.md": Page(
        there=(
            clone("examples/solve_game.py"),
            files(my__py=DRIVER.format("Mine"), few__json=FEW, one__json=ONE_GAME),
        ),
        replaced=lambda: {
            "suite run rules-2026": "suite run few.json",
            "ada=ada/rules-2026-c3ff293646d0.json": "ada=$(ls ada/*) --suite few.json",
            "suite run synthesis-2026": "suite run one.json",
        },
        before={"suite compare mine ada": typed("mkdir ada; cp mine/few-????????????.json ada")},
    ),
    "task.md": Page(there=(clone("docs/pictures"),)),
    "theory.md": Page(
        there=(
            clone("examples/solve_game.py", "benchmarks", "experiments", "tests"),
            files(**{"my-instance__json": dumps(SQUARE)}),
        ),
    ),
    "verdicts.md": Page(there=(recorded("town"), files(old__json=OLD, mine__json=MISSPELT))),
    "tour.md": Page(
        needs=(need_boxes,),
        before={"dubins-traffic evaluate": shorter},
        elsewhere=frozenset({"sh", "python", "toml"}),
    ),
    "tutorials/competition.md": Page(
        there=(clone("examples/competition"), lambda folder: competition_of(folder, "spring")),
        needs=(need_boxes,),
        environment=lambda: {"REPOSITORY": "."},
        before={"dubins-traffic submit": handed_in},
    ),
    "tutorials/ros.md": Page(
        there=(short_demo, clone("examples")),
        needs=(need_ros,),
        replaced=own_ports,
        environment=own_graphs,
    ),
    "website/index.md": Page(),
}
