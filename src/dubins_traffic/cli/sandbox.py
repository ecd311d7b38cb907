"""`dubins-traffic sandbox`."""

from __future__ import annotations

import json as json_text
import os
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options

if TYPE_CHECKING:
    from dubins_traffic.sandbox.suite import Strike

CHECK_EXAMPLES = options.examples("sandbox check", "sandbox check --json", "sandbox check --no-attacks")

app = typer.Typer(help="Boxes in which strangers' controllers drive.", no_args_is_help=True)


@app.callback()
def about() -> None:
    """Boxes in which strangers' controllers drive."""


@app.command("check", epilog=CHECK_EXAMPLES)
def check(
    attacks: Annotated[bool, typer.Option(help="Run the attacks, too.")] = True, json: options.Json = False
) -> None:
    """Say which limits hold on this machine for this user, and what enforces each; then attack a box.

    Exit status: 0 all hold; 1 an attack got through; 2 this machine can't hold a stranger's program.
    """
    from dubins_traffic.sandbox import images
    from dubins_traffic.sandbox.available import available_layers, held
    from dubins_traffic.sandbox.limits import Limits

    layers = available_layers()
    mechanisms = dict(held(layers))
    refused = images.why_not() or "; ".join(layers.missing())
    if not json:
        for limit, mechanism in mechanisms.items():
            print(f"{limit:<28} {mechanism or 'NOTHING'}")
        print(
            f"{'container images':<28} {f'refused: {refused}' if refused else 'podman unpacks them, into such boxes'}"
        )
        print(f"\nlimits, unless others are told: {asdict(Limits())}\n")
    strikes = [] if layers.missing() or not attacks else _attacked(quiet=json)
    through = [each.attack.name for each in strikes if not each.stopped]
    if json:
        document = {
            "user": os.getuid(),
            "limits": mechanisms,
            "missing": layers.missing(),
            "images": refused or None,
            "attacks": [_document(each) for each in strikes],
        }
        print(json_text.dumps(document, indent=2))
    elif strikes:
        print(f"{len(strikes) - len(through)} of {len(strikes)} attacks stopped")
    layers.require()
    if through:
        faults.tell(f"{len(through)} attacks got through: {'; '.join(through)}")
        raise typer.Exit(faults.FAILED)


def _attacked(*, quiet: bool) -> list[Strike]:
    """Run the attacks, a line each unless `quiet`."""
    from dubins_traffic.errors import shown
    from dubins_traffic.sandbox.available import available_layers
    from dubins_traffic.sandbox.suite import strikes

    landed: list[Strike] = []
    for each in strikes(available_layers()):
        landed.append(each)
        if not quiet:
            mark = "ok    " if each.stopped else "FAILED"
            print(f"{mark} {each.attack.name:<46} {'/'.join(each.attack.layers):<22} {shown(each.words, 90)}")
    return landed


def _document(each: Strike) -> dict[str, object]:
    attack = each.attack
    return {"name": attack.name, "layers": attack.layers, "stopped": each.stopped, "words": each.words}
