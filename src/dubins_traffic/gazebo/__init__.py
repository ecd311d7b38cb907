"""The simulator `gazebo`: the same trials with wheels, inertia and contact forces, behind the same protocol."""
