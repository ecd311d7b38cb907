#!/usr/bin/env bash
# Creates .venv and installs the package with one of its extras: scripts/setup.sh plot|dev
# The interpreter is $PYTHON, else the first Python >= 3.11 found.
set -euo pipefail
cd "$(dirname "$0")/.."
extra=${1:?usage: scripts/setup.sh plot|dev}

die() {
  echo "setup: $*" >&2
  exit 1
}

interpreter() {
  local name
  for name in ${PYTHON:-python3.11 python3.12 python3.13 python3.14 python3}; do
    if command -v "$name" >/dev/null && "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      echo "$name"
      return
    fi
  done
  die "no Python >= 3.11 found; on Debian 12: apt-get install python3 python3-venv; or set PYTHON"
}

ensure_venv_module() { # Debian keeps it in a package of its own
  "$1" -c 'import ensurepip, venv' 2>/dev/null && return
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "setup: installing python3-venv"
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends python3-venv; } >/dev/null
    "$1" -c 'import ensurepip, venv' 2>/dev/null && return
  fi
  die "$1 can't create virtual environments; on Debian: sudo apt-get install python3-venv, then run this again"
}

if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
  python=$(interpreter)
  ensure_venv_module "$python"
  echo "setup: creating .venv with $("$python" --version)"
  "$python" -m venv --clear .venv
fi
# A clone has no machine code: kernels are compiled here.
if [ "$extra" != dev ]; then wanted="$extra,compile"; else wanted=dev; fi
echo "setup: installing dubins-traffic[$wanted] into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable ".[$wanted]"
# On all processors, as pip doesn't, where processes can share a lock: a chroot without /dev/shm has none. What nobody here
# imports, a third of it, is left out, and would be compiled when it is imported.
# Some packages hold files that are no Python, at which this ends with another status.
jobs=0
.venv/bin/python -c 'import multiprocessing; multiprocessing.Lock()' 2>/dev/null || jobs=1
.venv/bin/python -m compileall -qq -j "$jobs" -x "/(tests|rllib|tune|serve|train|dashboard|devtools)/|/faker/providers/" .venv/lib || true
touch ".venv/.installed-$extra"
if [ "$extra" = dev ]; then touch .venv/.installed-plot; fi
