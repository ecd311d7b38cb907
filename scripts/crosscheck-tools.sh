#!/usr/bin/env bash
# Installs the tools with which some tests compare, each in an environment of its own in build/crosscheck:
# stormpy (carries Spot), rtamt, TuLiP, ltlf2dfa, omega with dd, SUMO, commonroad-io, Lanelet2; and Debian's spin and mona. What is there already is left alone.
# Where something can't be installed it says so in one line; the status is 0 either way.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build/crosscheck
# Old source packages are built with a setuptools that still has pkg_resources, also where pip builds apart.
export PIP_CONSTRAINT="$PWD/scripts/crosscheck-constraints.txt"
log=$(mktemp)
trap 'rm -f "$log"' EXIT

environment() { # name, module, packages...
  local name=$1 module=$2 python=$folder/$1/bin/python
  shift 2
  if [ -x "$python" ] && "$python" -c "import $module" >/dev/null 2>&1; then return; fi
  if .venv/bin/python -m venv --clear "$folder/$name" >"$log" 2>&1 &&
    "$python" -m pip install --quiet --disable-pip-version-check "$@" >>"$log" 2>&1 &&
    "$python" -c "import $module" >>"$log" 2>&1; then
    echo "crosscheck-tools: installed $name"
  else
    rm -rf "${folder:?}/$name"
    echo "crosscheck-tools: could not install $name: $(tail -n 1 "$log")"
  fi
}

mkdir -p "$folder"
environment stormpy stormpy 'stormpy==2.0.0'
environment rtamt rtamt 'rtamt==0.4.10' setuptools
environment ltlf2dfa ltlf2dfa.parser.ltlf 'ltlf2dfa==1.0.2'
environment tulip tulip.spec.form 'tulip==1.4.0' 'polytope==0.2.5' setuptools
environment omega dd.cudd,omega.games.gr1 'omega==0.4.0' 'dd==0.6.0' setuptools
environment sumo sumo 'eclipse-sumo==1.28.0'
environment commonroad commonroad.common.file_reader 'commonroad-io==2026.1'
environment lanelet2 lanelet2.io 'lanelet2==1.2.3'

missing=()
for program in spin mona; do
  command -v "$program" >/dev/null 2>&1 || missing+=("$program")
done
if [ "${#missing[@]}" -gt 0 ]; then
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  if command -v apt-get >/dev/null 2>&1 && $as_root apt-get update >"$log" 2>&1 &&
    $as_root env DEBIAN_FRONTEND=noninteractive \
      apt-get -o DPkg::Lock::Timeout=120 install -y --no-install-recommends "${missing[@]}" >>"$log" 2>&1; then
    echo "crosscheck-tools: installed ${missing[*]}"
  else
    echo "crosscheck-tools: could not install ${missing[*]}: $(tail -n 1 "$log")"
  fi
fi
