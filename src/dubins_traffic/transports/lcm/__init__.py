"""Drivers elsewhere over LCM: typed messages by UDP multicast (https://lcm-proj.github.io).

The messages are defined in ``dubins_traffic_lcm.lcm``; ``dubins_traffic_lcm/`` is what lcm-gen makes of it. Nothing
here loads the library `lcm` before a transport is opened or a car is driven.
"""
