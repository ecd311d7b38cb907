"""What an attack is: a small program, and the layers that must stop it."""

from __future__ import annotations

from dataclasses import dataclass

from dubins_traffic.protocols import End


@dataclass(frozen=True, slots=True)
class Attack:
    """A program that tries something in a box.

    Parameters
    ----------
    name : str
        What it tries.
    layers : tuple of str
        The layers (`sandbox.layers.NAMES`) of which each stops it alone.
    source : str
        Python. It sets `got` to what it has got hold of; whatever it raises has stopped it. `bait` holds what the
        suite has laid out on the host (`baits.Baits`), and `prelude` says what else it may use.
    end : End or tuple of End, optional
        How its driving must end, or one of several ways; then it is asked for a command, and may write what it likes to
        `answers`.
    alone : bool
        Whether it gets through once its layers are taken away, whoever runs it: of some calls the kernel has more to say.
    limits : tuple of (str, float)
        Limits that differ from the suite's, by name.
    """

    name: str
    layers: tuple[str, ...]
    source: str
    end: End | tuple[End, ...] = ()
    alone: bool = True
    limits: tuple[tuple[str, float], ...] = ()
