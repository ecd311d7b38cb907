"""Drivers elsewhere over LCM: typed messages by UDP multicast (https://lcm-proj.github.io).

The messages are defined in ``dubins_traffic_lcm.lcm``; ``dubins_traffic_lcm/`` is what scripts/lcm_messages.py makes of
it when the package is built or installed. Nothing here loads the library `lcm` before a transport is opened or a car is
driven.
"""
