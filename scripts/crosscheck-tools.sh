#!/usr/bin/env bash
# Installs the tools with which some tests compare, each in an environment of its own in build/crosscheck:
# Spot, stormpy (carries another Spot), rtamt, TuLiP, ltlf2dfa, omega with dd, SUMO, commonroad-io, Lanelet2, rclpy of two
# versions of ROS 2 with Fast DDS, RVO2 and CasADi; and Debian's spin and mona.
# With the argument `acacia` Acacia-Bonsai as well, which wants Python 3.13, and with `learners` Stable-Baselines3, which
# brings gigabytes. What is there already is left alone.
# Where something can't be installed it says so in one line; the status is 0 either way.
# Two are installed at a time, by the pip of .venv: to put one into each environment takes longer than most of the tools.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build/crosscheck
# Old source packages are built with a setuptools that still has pkg_resources, also where pip builds apart.
export PIP_CONSTRAINT="$PWD/scripts/crosscheck-constraints.txt"
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
log=$logs/apt

own=.venv/bin/python
base=$own

environment() { # name, module, packages...
  local name=$1 module=$2 python=$folder/$1/bin/python log=$logs/$1
  local pip=("$own" -m pip --python "$python") without=(--without-pip)
  [ "$base" = "$own" ] || { pip=("$python" -m pip) without=(); }
  shift 2
  if [ -x "$python" ] && "$python" -c "import $module" >/dev/null 2>&1; then return; fi
  if "$base" -m venv --clear "${without[@]}" "$folder/$name" >"$log" 2>&1 &&
    "${pip[@]}" install --quiet --disable-pip-version-check --no-compile "$@" >>"$log" 2>&1 &&
    "$python" -c "import $module" >>"$log" 2>&1; then
    echo "crosscheck-tools: installed $name"
  else
    rm -rf "${folder:?}/$name"
    echo "crosscheck-tools: could not install $name: $(tail -n 1 "$log")"
  fi
}

mkdir -p "$folder"
{
  environment spot spot 'spottl==2.13.0.1'
  environment stormpy stormpy 'stormpy==2.0.0'
  environment ltlf2dfa ltlf2dfa.parser.ltlf 'ltlf2dfa==1.0.2'
  environment sumo sumo 'eclipse-sumo==1.28.0'
  environment lanelet2 lanelet2.io 'lanelet2==1.2.3'
} &
environment rtamt rtamt 'rtamt==0.4.10' setuptools
# Its optimizers alone, which run in .venv: what else it needs is there.
environment psytaliro ppft --no-deps 'psy-taliro==3.2.0' 'pybanquo==0.1.1' 'pathos==0.3.5' 'ppft==1.7.8' 'dill==0.4.1' \
  'attrs>=24.1' 'sortedcontainers~=2.4'
# The libraries of methods of others, which run in .venv as well.
environment baselines ompl,pyrvo --no-deps -r experiments/baselines/orca/constraints.txt \
  -r experiments/baselines/mpc/constraints.txt -r experiments/baselines/rrt/constraints.txt
environment tulip tulip.spec.form 'tulip==1.4.0' 'polytope==0.2.5' setuptools
environment omega dd.cudd,omega.games.gr1 'omega==0.4.0' 'dd==0.6.0' setuptools
environment jazzy rclpy,visualization_msgs 'ros-rclpy~=7.1.6' 'ros-rmw-fastrtps-cpp~=8.4' 'ros-nav-msgs~=5.3' \
  'ros-visualization-msgs~=5.3'
environment kilted rclpy,visualization_msgs 'ros-rclpy~=9.1.2' 'ros-rmw-fastrtps-cpp~=9.3' 'ros-nav-msgs~=5.5' \
  'ros-visualization-msgs~=5.5'
environment commonroad commonroad.common.file_reader 'commonroad-io==2026.1'
wait

if [ "${1:-}" = acacia ]; then
  newer=$(compgen -G "${PYENV_ROOT:-$HOME/.pyenv}/versions/3.13*/bin/python3.13" | head -n 1 || true)
  newer=${newer:-$(command -v python3.13 || true)}
  if [ -n "$newer" ] && "$newer" -c 'import ensurepip, venv' 2>/dev/null; then
    base=$newer environment acacia acacia_boomslang 'acacia-boomslang==2.7.2'
  else
    echo "crosscheck-tools: Acacia-Bonsai wants Python 3.13, which is not here"
  fi
fi

if [ "${1:-}" = learners ]; then
  environment learners stable_baselines3 -r experiments/baselines/ppo/constraints.txt '.[rl]'
fi

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
