"""PPO, and PPO with a Lagrange multiplier; README.md says what it assumes."""
