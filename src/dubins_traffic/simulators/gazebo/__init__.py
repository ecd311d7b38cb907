"""Gazebo: the same trials on wheels, with inertia and contact, behind the same protocol."""
