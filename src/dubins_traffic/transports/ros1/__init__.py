"""ROS 1: the topics, services and parameters that programs of 2016 expect, over Debian's rospy (extra `ros1`).

`messages` finds the ROS packages of the system and makes those that Debian lacks, `master` starts a master, `node` is
this process in the graph, `world` publishes what Gazebo and the monitor did, and
`transport` serves what the maestro did and puts them together.
"""
