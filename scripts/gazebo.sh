#!/usr/bin/env bash
# Installs Gazebo for the tests into the user's cache, where it is missing and there is apt, and before it the compiler
# that it needs and the library that reads newer worlds; a second run is quick.
# Says in one line where it can't; the status is 0 either way.
set -euo pipefail
cd "$(dirname "$0")/.."
log=$(mktemp)
trap 'rm -f "$log"' EXIT

if ! command -v apt-get >/dev/null 2>&1; then
  echo "gazebo: no apt-get here; the tests of Gazebo are skipped unless it is installed"
  exit 0
fi
missing=()
command -v "${CXX:-g++}" >/dev/null 2>&1 || missing+=(g++)
ls /usr/lib/*/libsdformat12.so.12 >/dev/null 2>&1 || missing+=(libsdformat12-12)
if [ "${#missing[@]}" -gt 0 ]; then
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  $as_root apt-get update >"$log" 2>&1 &&
    $as_root env DEBIAN_FRONTEND=noninteractive \
      apt-get -o DPkg::Lock::Timeout=120 install -y --no-install-recommends "${missing[@]}" >>"$log" 2>&1 &&
    echo "gazebo: installed ${missing[*]}" || echo "gazebo: could not install ${missing[*]}: $(tail -n 1 "$log")"
fi
if .venv/bin/dubins-traffic gazebo install >"$log" 2>&1; then
  exit 0
fi
echo "gazebo: could not be installed: $(tail -n 1 "$log")"
