#!/usr/bin/env bash
# Runs every experiment again and stores what it shows, bars missed or not; then teaches the learners of the baselines
# anew, measures every baseline, and writes both pages. It stops at the first that fails; what is stored is kept.
set -euo pipefail
cd "$(dirname "$0")/.."
export PYTHONPATH=.
.venv/bin/python -m experiments --all --store || [ "$?" = 1 ]
.venv/bin/python examples/learning/clone.py
scripts/crosscheck-tools.sh learners
mkdir -p build/learners
for kind in ppo shielded lagrangian; do
  policies=()
  for seed in 1 2 3; do
    policies+=("build/learners/$kind-$seed.npz")
    build/crosscheck/learners/bin/python -m experiments.baselines.ppo.train "$seed" --save "${policies[-1]}" \
      $([ "$kind" = ppo ] || echo "--$kind")
  done
  .venv/bin/python -m experiments.baselines.ppo.seeds "$kind" "${policies[@]}"
done
PYTHONPATH=.:$(echo build/crosscheck/baselines/lib/python*/site-packages) \
  .venv/bin/python -m experiments.baselines --all --failures --page
