import os
import subprocess
import sys

PROGRAM = """
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads import lookup
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.packing import pack

table = pack([generate(12, 14, 1), generate(60, 80, 2, rigid_motion=True)], [0.6, 0.5])
draws = Draws(7, 0, 0)
for k in range(400):
    net = k & 1
    v = draws.between(int(table.vert_off[net]), int(table.vert_off[net + 1]) - 1)
    x = float(table.vertex[v].x) + draws.uniform(-4.0, 4.0)
    y = float(table.vertex[v].y) + draws.uniform(-4.0, 4.0)
    s, d2 = lookup.nearest_segment(table, net, x, y)
    v, v2 = lookup.nearest_vertex(table, net, x, y)
    lane = 2 * int(s) + (k >> 1 & 1)
    along, left = lookup.lane_coordinates(table, net, lane, x, y)
    tips = int(lookup.lane_start(table, net, lane)), int(lookup.lane_end(table, net, lane))
    numbers = (d2, v2, along, left, *lookup.lane_direction(table, net, lane))
    print(int(s), int(v), bool(lookup.on_road(table, net, x, y)), tips, [float(n).hex() for n in numbers])
"""


def _run(plain: str) -> str:
    environment = {**os.environ, "NUMBA_DISABLE_JIT": plain}
    return subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, check=True, capture_output=True, text=True
    ).stdout


def test_compiled_and_interpreted_look_ups_are_equal_bit_for_bit() -> None:
    compiled = _run("0")
    assert compiled.count("True") > 50
    assert compiled.count("False") > 50
    assert compiled == _run("1")
