"""Attacks on a box: small programs, each with the layers that must stop it.

`dubins-traffic sandbox check` runs them all. With one of its layers taken away an attack gets through, or the tests of
the suite would not notice that the layer is gone.
"""

from dubins_traffic.sandbox.attacks.attack import BOMBS, CALLS, LIES, REACH, Attack

ATTACKS: tuple[Attack, ...] = (*REACH, *CALLS, *BOMBS, *LIES)
"""All of them."""
