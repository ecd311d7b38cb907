#!/usr/bin/env bash
# Generates the Python code of the LCM messages from their definition, with the lcm-gen of the extra `lcm`:
# scripts/lcm-messages.sh [FOLDER]. Without a folder, in its place in the package.
set -euo pipefail
cd "$(dirname "$0")/.."
room=src/dubins_traffic/transports/lcm
out=${1:-$room/dubins_traffic_lcm}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
.venv/bin/lcm-gen --python --ppath "$scratch" --package-prefix dubins_traffic.transports.lcm "$room/dubins_traffic_lcm.lcm"
mkdir -p "$out"
rm -f "$out"/*.py
cp "$scratch"/dubins_traffic/transports/lcm/dubins_traffic_lcm/*.py "$out"
