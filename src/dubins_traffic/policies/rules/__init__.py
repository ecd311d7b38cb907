"""The policy that keeps the rules of the road (docs/rules.md), for e-agents and the ego alike (compiled).

Beside those of `dubins_traffic.kernels`, these parameters mean the same in every kernel of this room.

===========  =====  ============================================================================================
out          int    the lane after `lane`, or out of a disc: 2 s + d
part         int    where a car is on its way: one of `turn_arcs.PART`
key          float  progress on that part: m, in an arc 1 less the cosine of the angle driven
left         float  offset to the left of a way, of a line or of the middle of a lane, m
offset       float  how far left of the middle of its lane a car is to drive, m
along        float  coordinate along a lane, m
aside        float  coordinate to the left of the centre line of a lane, m
own, back    float  along its lane from its end, negative, m: where a car is; where it is to be back in it
to_go        float  distance of a car to the end of its lane, m
begin, end   float  a stretch of a lane: along it from here to there, m
first, last  int    obstacle parts `first` to `last` - 1; in `command_cache` cars of a block
done, early  float  along a lane: least begin of obstacles that are looked at; that can be passed in it, m
low, high    float  corridor in which a car minds what is ahead: offsets to the left of its way, m
wide         float  width to either side that has to be free, m
near         int    number of cars in the list `Scratch.near`
count        int    number of cars in it so far
who          int    what is ahead: a car, -2 - p for obstacle part p, -1 for nothing
j            int    another car, 0 to N - 1
p            int    a part of an obstacle
trusted      int    a car that need not be minded, -1 for none
inside       int    how many cars are in a disc and will leave it before this one
gap, kept    float  the gap to what is ahead, and the gap to keep from it, m
comes        float  distance that an oncoming car may drive in the time, m
outside      bool   whether a car is in its lane, outside the discs
gated        bool   whether it is before the disc at the end of its lane
chooses      bool   whether it is in a crossing, where it may take another exit
rides        bool   whether it tailgates the car ahead
close        bool   whether any body is close
hurries      bool   whether it drives as fast as it can
in_disc      bool   whether its body meets a disc
company      int    what is known of the cars around a car: one of `tables.COMPANY`
kind         int    what drives a car: one of `tables.KIND`
sight2       float  square of how far the ego sees others, m2; negative: it sees all
bend         float  curvature of the line that a car drives, 1/m
most         float  sine of the largest angle to its line at which it drives
aligned      float  cosine of the angle to where it should head beyond which it turns in place
limit        float  largest yaw rate, rad/s
tightest     float  turning radius, m; 0: it turns in place
bits         Any    flags of a car, of `FLAG`
degree       Any    how many segments meet in an intersection
turn         int    for how many ticks it has been a car's turn
===========  =====  ============================================================================================
"""
