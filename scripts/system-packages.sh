#!/bin/sh
# Install the system packages that the tests need: Chromium and its driver, for the tests of pages; nginx, PostgreSQL and
# SQLite's command, for the tests of the service; libraries that LCM's wheel and the programs of SUMO's are linked with; ROS 1, a compiler and Fast DDS, for the tests over ROS 1 and 2;
# bubblewrap, libseccomp and podman, for boxes (docs/sandbox.md), and QEMU, for a kernel of its own. Does nothing where they
# are, and says in one line what it can't install; the status is 0 either way.
set -eu

ros="python3-rospy python3-rosmaster python3-roslaunch python3-genpy python3-gencpp python3-nav-msgs"
ros="$ros python3-sensor-msgs python3-geometry-msgs python3-std-srvs python3-tf2-msgs ros-geometry-msgs ros-std-msgs"
ros="$ros libroscpp-dev libsensor-msgs-dev libgeometry-msgs-dev libstd-msgs-dev g++ pkg-config libfastrtps-dev"

has() {
    for command in "$@"; do command -v "$command" >/dev/null 2>&1 || return 1; done
}
installed() {
    for package in "$@"; do dpkg -s "$package" >/dev/null 2>&1 || return 1; done
}

libraries="libglib2.0-0 libx11-6 libxext6 libxrender1 libgl1 libatomic1"

missing=""
has chromium chromedriver || missing="chromium chromium-driver"
installed bubblewrap libseccomp2 podman || missing="$missing bubblewrap libseccomp2 podman"
has qemu-system-x86_64 || missing="$missing qemu-system-x86"
# shellcheck disable=SC2086 # a list of words
installed $ros || missing="$missing $ros"
installed nginx openssl postgresql-15 sqlite3 || missing="$missing nginx openssl postgresql-15 sqlite3"
# shellcheck disable=SC2086 # a list of words
installed $libraries || missing="$missing $libraries"
[ -n "$missing" ] || exit 0

if ! has apt-get; then
    echo "system-packages: no apt-get here; install by hand: $missing"
    exit 0
fi

if [ "$(id -u)" -eq 0 ]; then
    as_root=""
elif has sudo && sudo -n true 2>/dev/null; then
    as_root="sudo -n"
else
    echo "system-packages: neither root nor sudo without a password; install by hand: $missing"
    exit 0
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
# shellcheck disable=SC2086 # lists of words
if $as_root apt-get update >"$log" 2>&1 &&
    $as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get -o DPkg::Lock::Timeout=120 install -y --no-install-recommends $missing >>"$log" 2>&1; then
    echo "system-packages: installed $missing"
else
    echo "system-packages: could not install $missing: $(tail -n 1 "$log")"
fi
exit 0
