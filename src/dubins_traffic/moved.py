"""Modules that pages of the documentation once named elsewhere: their earlier names can still be imported."""

from __future__ import annotations

import sys

TYPE_CHECKING = False
if TYPE_CHECKING:  # without these modules importing the package stays quick
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

PLACES = {
    "agents.whims": "falsification.whims",
    "controllers.learned": "learning.policy",
    "observations.flat": "learning.flat",
    "roads.formats.foreign": "maps.foreign",
    "roads.formats.xml_text": "maps.xml_text",
    "roads.maps": "maps",
    "viewer.animate": "animation.animate",
    "viewer.live": "animation.live",
    "viewer.raster": "animation.raster",
}
"""Earlier names below the package, and where the modules are, or the packages with all that they hold."""
_HEAD = "dubins_traffic."


class Moved:
    """Finds modules by their earlier names, before a module in a package of such a name is loaded a second time."""

    def find_spec(
        self,
        name: str,
        path: Sequence[str] | None = None,  # noqa: ARG002  # an earlier name says enough
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Return how the module of an earlier name is imported, None for any other name."""
        if place_of(name) is None:
            return None
        from importlib.machinery import ModuleSpec

        return ModuleSpec(name, self)  # pyright: ignore[reportArgumentType]

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """Return the module itself: there is one of it, whatever it is called."""
        import warnings
        from importlib import import_module

        place = place_of(spec.name)
        if place is None:
            return None
        warnings.warn(f"{spec.name} has moved: import {place}", DeprecationWarning, stacklevel=2)
        module = import_module(place)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Leave the module as it is, with its own name."""
        module.__spec__ = self._spec


def place_of(name: str) -> str | None:
    """Return the full name of the module that was called `name`, None unless that is an earlier name."""
    if not name.startswith(_HEAD):
        return None
    below = name[len(_HEAD) :]
    package, _, module = below.rpartition(".")
    if below in PLACES:
        return _HEAD + PLACES[below]
    return f"{_HEAD}{PLACES[package]}.{module}" if package in PLACES else None


def keep_earlier_names() -> None:
    """Let Python know the earlier names."""
    sys.meta_path.insert(0, Moved())  # pyright: ignore[reportArgumentType]
