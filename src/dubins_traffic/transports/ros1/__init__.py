"""ROS 1: the topics, services and parameters that programs of 2016 expect, over Debian's rospy (extra `ros1`).

`debian` finds the system's ROS packages, `messages` makes those that Debian lacks, `master` starts a master, `node` is
this process in the graph, `world` publishes what Gazebo and the monitor did, `services` serves what the maestro did,
and `transport` puts them together.
"""
