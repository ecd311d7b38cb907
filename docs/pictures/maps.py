"""Draws the gallery of docs/maps.md: what was lost of `examples/maps` and of towns of SUMO, and a drawn network.

python docs/pictures/maps.py [GAMES]
"""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from dubins_traffic.animation.plot import write_plot
from dubins_traffic.maps.foreign import ForeignFormat
from dubins_traffic.maps.loss_picture import write_losses
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[1] / "examples" / "maps"
TOWNS = {"DRT/osm.net.xml": "maps-drt", "bs3d/bs.net.xml": "maps-bs3d"}
BENT = 16, 22, 7
"""Intersections, segments and seed of a network that bends."""


def draw(source: Path, name: str) -> None:
    """Draw what was lost of a map, and print the table."""
    text = source.read_text()
    form = registry.of_text(text)
    if not isinstance(form, ForeignFormat):
        raise SystemExit(f"{source}: not a map of another program")
    document, losses = form.reduced(text, str(source))
    write_losses(HERE / f"{name}.svg", losses, overwrite=True)
    if source.parent == EXAMPLES:
        write_plot(HERE / f"{name}-network.svg", RoadNetwork.from_document(document), overwrite=True)
    print(name, *losses.lines(), sep="\n")


def main() -> None:
    """Draw all."""
    parser = ArgumentParser(description="Draw the pictures of docs/maps.md.")
    parser.add_argument("games", nargs="?", type=Path, help="SUMO's folder tools/game, for its two towns")
    games = parser.parse_args().games
    write_plot(HERE / "maps-bent.svg", generate(*BENT, bent=0.7), overwrite=True)
    draw(EXAMPLES / "crossing.osm", "maps-crossing")
    for file, name in TOWNS.items():
        if games:
            draw(games / file, name)


if __name__ == "__main__":
    main()
