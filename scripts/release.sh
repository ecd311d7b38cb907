#!/usr/bin/env bash
# Makes wheel and source distribution in dist/, and tries both, each in an environment of its own, with every Python from 3.11
# to 3.14 that is found. The wheel holds machine code for each level of processors. The same trial must give the same score
# everywhere, and take no compiler and 170 MB at most with all that it needs.
set -euo pipefail
cd "$(dirname "$0")/.."
unset PYTHONPATH # what is tried is what is installed
MOST=170
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

rm -rf dist
for level in x86-64-v2 x86-64-v3 x86-64-v4; do
  NUMBA_CACHE_DIR="$work/cache" .venv/bin/dubins-traffic build --level "$level" --folder "$work/machine"
done
DUBINS_TRAFFIC_MACHINE="$work/machine" .venv/bin/python -m build --outdir dist . >"$work/build.log" 2>&1 || { tail -20 "$work/build.log" >&2; exit 1; }
wheel=$(echo dist/*.whl)
sources=$(echo dist/*.tar.gz)
echo "release: $wheel $sources"

tried=0
for name in python3.11 python3.12 python3.13 python3.14; do
  for python in $(compgen -G "${PYENV_ROOT:-$HOME/.pyenv}/versions/${name#python}*/bin/$name" || command -v "$name" || true); do
    "$python" -c 'import venv' 2>/dev/null || continue
    for package in "$wheel" "$sources"; do
      rm -rf "$work/environment"
      "$python" -m venv "$work/environment"
      empty=$(du -sm "$work/environment/lib" | cut -f1)
      "$work/environment/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt "$root/$package"
      size=$(($(du -sm "$work/environment/lib" | cut -f1) - empty))
      [ "$size" -le "$MOST" ] || { echo "release: $package takes $size MB installed, more than $MOST" >&2; exit 1; }
      (cd "$work" && "$work/environment/bin/dubins-traffic" run demo --trials 1 --json >"$work/score.json" 2>"$work/said")
      if [ "$package" = "$wheel" ] && grep -q "machine code" "$work/said"; then cat "$work/said" >&2; exit 1; fi
      "$work/environment/bin/python" - "$work" <<'PYTHON'
import json, sys
from pathlib import Path
folder = Path(sys.argv[1])
def kept(value):
    if isinstance(value, dict):
        return {key: kept(own) for key, own in value.items() if "wall" not in key and "begin" not in key}
    return [kept(own) for own in value] if isinstance(value, list) else value
score = kept(json.loads((folder / "score.json").read_text()))
first = folder / "first.json"
if not first.exists():
    first.write_text(json.dumps(score))
sys.exit(json.loads(first.read_text()) != score)
PYTHON
      "$work/environment/bin/dubins-traffic" --version | grep -q "commit $(git rev-parse HEAD)"
      echo "release: $("$python" --version): ${package#dist/}: installs, runs, the same score"
      tried=$((tried + 1))
    done
    break
  done
done
[ "$tried" -gt 0 ]
