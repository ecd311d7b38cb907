#!/usr/bin/env bash
# Fetches Debian's packages of Gazebo 11 and unpacks them below PREFIX/root, without root and without installing them:
# scripts/gazebo-packages.sh PREFIX. `dubins-traffic gazebo install` runs it; a wheel carries it beside the module.
# apt works in PREFIX/apt, with an empty list of installed packages; its mirrors and its settings of the network are those
# of this machine. Says on standard output what it does, and the share of it that is done, in percent: "download 12". What
# has been done is kept, and it goes on where it stopped. The last line of standard error says why it could not.
set -euo pipefail
export LC_ALL=C
trap '' XFSZ # where files may not grow, what writes one says so
suite=bullseye # the release of Debian that has Gazebo 11
run=(gazebo gazebo-plugin-base)
# What the plugin is compiled against; what these depend on is not needed.
headers=(libboost1.74-dev libgazebo-dev libignition-common-dev libignition-math-dev libignition-msgs-dev
  libignition-transport-dev libprotobuf-dev libsdformat-dev uuid-dev)
of_the_machine='^(libc6|libgcc-s1|libstdc\+\+6)_' # never unpacked: programs use this machine's own
workers=2

die() {
  echo "$*" >&2
  exit 1
}

for program in apt-get dpkg-deb; do
  command -v $program >/dev/null ||
    die "Gazebo is installed from Debian's packages, and this machine can't handle them: no $program; expected Debian or a system made of it, or a gzserver of one's own on the path"
done
prefix=$(realpath -m "${1:?usage: gazebo-packages.sh PREFIX}")
home=$prefix/apt root=$prefix/root
log=$home/log

last() { grep . "$log" | tail -n 1 | cut -c 1-200 || echo "it said nothing"; }
our_apt() { apt-get -c "$home/apt.conf" "$@"; }
size_of() { du -sb "$1" 2>/dev/null | cut -f 1; }

settings() { # hooks of this machine's apt would touch its own folders, and are left out
  printf '%s;\n' "Dir::State \"$home\"" "Dir::State::lists \"$home/lists\"" "Dir::State::status \"$home/status\"" \
    "Dir::Cache \"$home\"" "Dir::Cache::archives \"$home/archives\"" "Dir::Etc::sourcelist \"$home/sources.list\"" \
    'Dir::Etc::sourceparts "/dev/null"' 'Dir::Etc::preferences "/dev/null"' 'Dir::Etc::preferencesparts "/dev/null"' \
    'APT::Install-Recommends "false"' 'Acquire::Languages "none"' 'Acquire::Retries "3"' \
    'Acquire::Check-Valid-Until "false"' "#clear APT::Update::Pre-Invoke" "#clear APT::Update::Post-Invoke" \
    "#clear APT::Update::Post-Invoke-Success"
  [ "$(id -u)" != 0 ] || echo 'APT::Sandbox::User "root";'
}

listed() { # the list of the suite's packages, from the first of this machine's mirrors that has it
  local keys=/usr/share/keyrings/debian-archive-keyring.gpg signed="" said="no source of packages is set up" mirror count=0
  [ ! -f $keys ] || signed=" [signed-by=$keys]"
  for mirror in $({ apt-get --print-uris update 2>/dev/null || true; } |
    sed -nE "s|^'([^']+)/dists/[^']+/InRelease'.*|\1|p" | awk '!known[$0]++'); do
    echo "list of packages $((10 * count++))"
    echo "deb$signed $mirror $suite main" >"$home/sources.list"
    if our_apt update --error-on=any >"$log" 2>&1; then
      echo "list of packages 100"
      return
    fi
    said=$(last)
  done
  die "no package mirror of this machine gives $suite ($said); expected a Debian mirror with $suite among apt's sources"
}

wanted() { # a line for each package that is not unpacked yet, headers last: its file and its size
  {
    our_apt --print-uris -qq -o "Dir::Cache::archives=$home/none" install "${run[@]}" && # what is here would be left out
      our_apt --print-uris -qq download "${headers[@]}"
  } 2>"$log" | sed -nE "s/^'[^']+' (\S+) ([0-9]+).*/\1 \2/p" | grep -vE "$of_the_machine" |
    while read -r file size; do
      [ -e "$home/unpacked/$file" ] || echo "$file $size"
    done
}

fetch() { # names
  local total apt
  total=$(awk '{ sum += $2 } END { print sum + 1 }' "$home/wanted")
  (cd "$home/archives" && exec apt-get -c "$home/apt.conf" -qq download "$@") >"$log" 2>&1 &
  apt=$!
  trap 'kill $apt 2>/dev/null || true' EXIT
  while kill -0 $apt 2>/dev/null; do
    sleep 0.3
    echo "download $((99 * $(size_of "$home/archives") / total))"
  done
  trap - EXIT
  wait $apt || die "apt can't fetch Gazebo ($(last))"
  echo "download 100"
}

unpack() { # home root file total
  if ! dpkg-deb --extract "$1/archives/$3" "$2" 2>"$1/archives/$3.log"; then
    echo "$3: can't be unpacked ($(tail -n 1 "$1/archives/$3.log"))" >&2
    rm -f "$1/archives/$3"
    exit 255 # at which xargs stops
  fi
  touch "$1/unpacked/$3"
  rm -f "$1/archives/$3" "$1/archives/$3.log"
  set -- "$1"/unpacked/* "$4"
  echo "unpack $((100 * ($# - 1) / ${!#}))"
}
export -f unpack

mkdir -p "$home"/{archives/partial,lists/partial,none/partial,unpacked} "$root"
touch "$home/status"
settings >"$home/apt.conf"
listed
wanted >"$home/wanted" || die "apt can't find Gazebo ($(last))"
[ -s "$home/wanted" ] || exit 0
mapfile -t names < <(cut -d _ -f 1 "$home/wanted")
fetch "${names[@]}"
total=$(($(wc -l <"$home/wanted") + $(find "$home/unpacked" -type f | wc -l)))
cut -d ' ' -f 1 "$home/wanted" | xargs -P $workers -I FILE bash -c 'unpack "$@"' unpack "$home" "$root" FILE $total
