"""Environments for reinforcement learning, on the batch engine; importing this room registers them in Gymnasium."""

from dubins_traffic.envs.registration import register

register()
