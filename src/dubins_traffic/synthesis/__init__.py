"""The game of cells behind the task: positions, moves, an explicit GR(1) solver, strategies and counterstrategies."""
