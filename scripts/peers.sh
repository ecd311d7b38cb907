#!/usr/bin/env bash
# Installs the simulators that `python -m benchmarks peers` compares with, or those named, each in a virtual environment
# of its own: build/peers/NAME, with the versions of benchmarks/peers/NAME.txt. What is there already is left alone.
# Where one can't be installed it says so in one line; the status is 0 either way.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${PEERS:-build/peers}
log=$(mktemp)
trap 'rm -f "$log"' EXIT

environment() { # name
  local at=$folder/$1 wanted=benchmarks/peers/$1.txt
  if ! [ -f "$wanted" ]; then
    echo "peers: $1 is unknown: there is no $wanted"
    return
  fi
  if cmp -s "$wanted" "$at/installed.txt"; then return; fi
  if .venv/bin/python -m venv --clear "$at" >"$log" 2>&1 &&
    "$at/bin/python" -m pip install --quiet --disable-pip-version-check -r "$wanted" >>"$log" 2>&1; then
    cp "$wanted" "$at/installed.txt"
    echo "peers: installed $1"
  else
    rm -rf "${at:?}"
    echo "peers: could not install $1: $(grep . "$log" | tail -n 1)"
  fi
}

mkdir -p "$folder"
if [ "$#" -eq 0 ]; then
  set -- benchmarks/peers/*.txt
fi
for each in "$@"; do environment "$(basename "$each" .txt)"; done
