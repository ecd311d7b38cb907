"""Drivers elsewhere over ROS 2, by DDS: ROS 2's names of topics and types, without ROS 2 (extra `ros2`).

Everything here but `names` loads the library `cyclonedds`.
"""
