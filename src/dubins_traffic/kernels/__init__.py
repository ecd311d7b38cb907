"""Compiled functions on bare arrays and numbers, shared by several rooms.

Kernels use only ``+ - * /`` and square roots on floats, so that every machine gives the same bits. They never
raise and never allocate per car. Each runs unchanged as plain Python (``NUMBA_DISABLE_JIT=1``).

These parameters mean the same in every kernel of the package; docstrings say what the others are. Lengths are in
metres, angles in radians, times in seconds, points in the world frame.

===============  =======  ============================================================================================
b                int      number of the trial in its batch, 0 to B - 1
n                int      number of the car, 0 to N - 1; 0 is the ego
v                int      intersection, 0 to V - 1
net              int      number of the road network in its table
lane             int      2 s + d: segment s driven from its first end to its second (d = 0), or back (d = 1)
segment          int      segment, 0 to S - 1
tick             int      number of the frame that is made or labelled; 0 is the first
x, y             float    a centre or another point, m
px, py           float    a point, m
c, s             float    heading: cosine and sine
tx, ty           float    a direction: unit vector
x0, y0, x1, y1   float    centres of the first and the second of two bodies, m
c0, s0, c1, s1   float    their headings: cosine and sine
a0, b0, a1, b1   float    half lengths and half widths of their cores, m
r0, r1           float    their roundings, m
u0, w0, u1, w1   float    their speeds, m/s, and yaw rates, rad/s
until0, until1   float    for how long they move in the tick, s; then they stand
ox, oy           float    centre of another body, m
oc, os           float    its heading: cosine and sine
speed            float    m/s
yaw_rate         float    rad/s
dt, period       float    length of a tick, s
half_length      float    half the length of a body's core, which `rounding` surrounds, m
half_width       float    half the width of a body's core, m
rounding         float    radius by which a body's core is rounded, m; a disc is all rounding
reach            float    distance from a body's centre to its farthest point, m
seed             Any      seed of the trial, uint64
trial            int      number of the trial by which random numbers are drawn
others           int      number of e-agents in a game of cells
commands         Floats   (B, N, 2) speed (m/s) and yaw rate (rad/s)
command, most    Command  what is asked for, or the most that is: speed, m/s, and yaw rate, rad/s
tables           Any      all tables that the kernel's room takes; their classes state shapes and units
vertex           int      intersection, 0 to V - 1, or -1
lateral          float    left of a lane's centre line positive, m
since            int      tick, -1 for never
block            Any      columns of BLOCK cars; its class states units
===============  =======  ============================================================================================
"""
