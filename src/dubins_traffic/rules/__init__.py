"""The rules of the road: propositions, queues, the referee, and the task as formulas (docs/rules.md).

Beside those of `dubins_traffic.kernels`, these parameters mean the same in every kernel of this room.

===========  =====  ===============================================================================
ago          int    a number of ticks
along        float  how far along a lane out of a disc a point lies, m
away2, far2  float  squared distance from an intersection, and the one up to which a point is near it, m2
spare        float  how far a car may move without a change of its labels, m
low, high    float  a lateral interval, m
needed       float  width of a right lane that has to be free, m
lane_width   float  how wide a right lane is, m
width        float  how far right of the centre line a lane reaches, m
top          float  greatest progress since the lane state was set, m
back         int    the segment by which a car came to a bend, which is no exit for it, -1 for none
count        int    number of cars to look at
goal         int    an intersection, 0 to V - 1
rule         int    number of a rule in `breach_log.RULES`
fresh        bool   whether the lane state has been set in this frame
stopped      bool   whether the car had stopped in the frame before, at the crossing that it enters
===========  =====  ===============================================================================
"""
