"""Environments for learning, Gymnasium's, on the batch engine. Importing this room makes their names known to it."""

from dubins_traffic.envs.registration import register

register()
