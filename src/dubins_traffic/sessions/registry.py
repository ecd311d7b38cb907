"""The transports over which sessions run: one entry holds all that the command line and tests need of each.

No heavy module is imported here; the function that runs a session is imported by name when it is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dubins_traffic.runs.single import Result


@dataclass(frozen=True, slots=True)
class Option:
    """An option of one transport.

    Parameters
    ----------
    flag : str
        The option as it is typed: ``--port``.
    kind : type
        ``bool``, ``int``, ``float`` or ``str``.
    help : str
        One line.
    name : str
        The parameter of the function that runs the session; by default the flag without its hyphens.
    default : bool, int or str, optional
        Its value if it is not given.
    metavar : str, optional
        Stands for its value in the help text.
    low, high : number, optional
        Bounds of its value.
    shown : str, optional
        Replaces the default in the help text.
    """

    flag: str
    kind: type[bool] | type[int] | type[float] | type[str]
    help: str
    name: str = ""
    default: bool | int | str | None = None
    metavar: str | None = None
    low: float | None = None
    high: float | None = None
    shown: str | None = None

    @property
    def parameter(self) -> str:
        """Name of the parameter that gets its value."""
        return self.name or self.flag.removeprefix("--")


@dataclass(frozen=True, slots=True)
class TransportEntry:
    """The registry's entry for a transport.

    Parameters
    ----------
    runs : callable or str
        Runs a session: called with a `plan.SessionPlan`, a `plan.Pace` and the `options` by name, it yields the results
        of trials. ``module:function`` is imported when it is asked for.
    line : str
        Help text of the command ``dubins-traffic NAME``.
    about : str
        Help text of ``dubins-traffic NAME run``.
    examples : tuple of str
        Command lines, without the program's name.
    options : tuple of Option
        Options of ``run``, beside those that all transports share.
    remappings : bool
        Whether ``name:=value``, as roslaunch adds to a command line, is ignored.
    """

    runs: Callable[..., Iterator[Result]] | str
    line: str
    about: str
    examples: tuple[str, ...]
    options: tuple[Option, ...] = ()
    remappings: bool = False

    @property
    def runner(self) -> Callable[..., Iterator[Result]]:
        """The function that runs a session."""
        if not isinstance(self.runs, str):
            return self.runs
        module, _, name = self.runs.partition(":")
        run_session: Any = getattr(import_module(module), name)
        return run_session


CLOCK = Option("--clock", bool, "Publish /clock, and stamp messages with simulated time.", default=False)
ELSEWHERE = Option(
    "--maestro-elsewhere",
    bool,
    "Another process, such as that of 2016, is the maestro; simulator and referee are here.",
    name="elsewhere",
    default=False,
)


def _outside(world: str) -> tuple[Option, ...]:
    """Return the options of a transport over which cars of a world outside, of that name, are driven and judged."""
    return (
        Option(
            "--simulator",
            str,
            f"What moves the cars; {world}: they are in a world that is not ours.",
            metavar="S",
        ),
        Option("--poses", str, "Of that world: PoseStamped of each car, {} for its name.", metavar="TOPIC"),
        Option(
            "--delay",
            float,
            "Of that world: how late commands take effect, seconds.",
            metavar="S",
            low=0.0,
            shown="measured",
        ),
        Option(
            "--noise",
            float,
            "Of that world: how far poses are off at most, metres.",
            metavar="M",
            low=0.0,
            shown="measured",
        ),
        Option(
            "--loss",
            float,
            "Of that world: the share of commands that may get lost; with 0 cars keep less of a margin.",
            metavar="P",
            low=0.0,
            high=1.0,
            shown="0.05",
        ),
    )


TRANSPORTS: dict[str, TransportEntry] = {
    "ros1": TransportEntry(
        runs="dubins_traffic.sessions.ros1:run_over_ros1",
        line="Trials over ROS 1, with the topics and services of 2016.",
        about="Be simulator, maestro and monitor of 2016 in one process. Ctrl-C ends it and keeps all finished trials.",
        examples=(
            "ros1 run demo --master",
            "ros1 run my-trials.json --master --port 11411 --trials 3 --records out -f data.json",
            "ros1 run demo --remote agent0 --controller lanes --lockstep",
            "ros1 run demo --master --maestro-elsewhere --records out",
        ),
        options=(
            Option(
                "--master",
                bool,
                "Start a ROS master on this machine, at --port; without it, join one.",
                default=False,
            ),
            Option(
                "--port",
                int,
                "Of that master; 0: any free one.",
                default=11311,
                metavar="PORT",
                low=0,
                high=65535,
            ),
            ELSEWHERE,
            CLOCK,
            *_outside("ros1-world"),
        ),
        remappings=True,
    ),
    "lcm": TransportEntry(
        runs="dubins_traffic.sessions.lcm:run_over_lcm",
        line="Trials over LCM, with typed messages by UDP multicast.",
        about="Run trials whose ego, or some of whose e-agents, are driven over LCM. Ctrl-C keeps all finished trials.",
        examples=(
            "lcm run demo --lockstep",
            "lcm run my-trials.json --trials 3 --records out --url udpm://239.255.76.67:7700?ttl=0",
            "lcm run demo --remote agent0 --controller lanes",
        ),
        options=(
            Option(
                "--url",
                str,
                "Where messages go.",
                metavar="URL",
                shown="$LCM_DEFAULT_URL, else multicast within this machine",
            ),
            Option("--wait", bool, "Begin each trial when a program asks START, not at once.", default=False),
        ),
    ),
    "ros2": TransportEntry(
        runs="dubins_traffic.sessions.ros2:run_over_ros2",
        line="Trials over ROS 2 by DDS, with the topics of 2016.",
        about="Be simulator, maestro and monitor for nodes of ROS 2. Ctrl-C ends it and keeps all finished trials.",
        examples=(
            "ros2 run demo",
            "ros2 run my-trials.json --domain 7 --trials 3 --records out",
            "ros2 run demo --remote agent0 --controller lanes --lockstep",
        ),
        options=(
            Option("--domain", int, "DDS domain.", metavar="N", low=0, high=232, shown="$ROS_DOMAIN_ID, else 0"),
            Option(
                "--wide",
                bool,
                "Beyond this machine, as $CYCLONEDDS_URI or Cyclone's defaults say.",
                default=False,
            ),
            ELSEWHERE,
            CLOCK,
            Option(
                "--markers",
                bool,
                "Publish markers of roads, goals and cars for RViz: /dubins_traffic/roads, /dubins_traffic/cars.",
                default=False,
            ),
            *_outside("ros2-world"),
        ),
    ),
    "lines": TransportEntry(
        runs="dubins_traffic.sessions.lines:run_over_lines",
        line="Trials over JSON lines on a socket of this machine.",
        about="Run trials whose ego, or some of whose e-agents, are driven over a socket. "
        "Ctrl-C keeps all finished trials.",
        examples=(
            "lines run demo --lockstep --port 7411",
            "lines run my-trials.json --trials 3 --records out",
            "lines run demo --remote agent0 --controller lanes --lockstep",
        ),
        options=(
            Option(
                "--port",
                int,
                "Where to listen; 0: any free one.",
                default=0,
                metavar="PORT",
                low=0,
                high=65535,
            ),
        ),
    ),
    "stdio": TransportEntry(
        runs="dubins_traffic.sessions.stdio:run_over_stdio",
        line="Trials over JSON lines on the standard streams of programs that are begun with them.",
        about="Run trials whose ego, or some of whose e-agents, are driven by programs that speak lines on their "
        "standard streams. Ctrl-C keeps all finished trials.",
        examples=(
            "stdio run demo --lockstep --program './drive --fast'",
            "stdio run demo --lockstep --program program:drive --sandbox",
            "stdio run demo --remote agent0 --controller lanes --lockstep --program ./wander",
        ),
        options=(
            Option(
                "--program",
                str,
                "What is begun for each remote car with each trial: a command line; in a box program:PATH, a folder "
                "with controller.toml, or a controller.",
                metavar="COMMAND",
                shown="required",
            ),
            Option("--sandbox", bool, "It runs in a box.", default=False),
        ),
    ),
}
"""By name, in the order of the help text; a new transport is its own file and an entry here."""
