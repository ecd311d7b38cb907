#!/bin/sh
# Install the system packages that the tests need: Chromium and its driver, for the test of the replay page.
# Does nothing where they are, and says so in one line where it can't install them; the status is 0 either way.
set -eu

present() {
    command -v chromium >/dev/null 2>&1 && command -v chromedriver >/dev/null 2>&1
}

if present; then
    exit 0
fi

if ! command -v apt-get >/dev/null 2>&1; then
    echo "system-packages: no apt-get here; install chromium and chromium-driver by hand to test the replay page"
    exit 0
fi

if [ "$(id -u)" -eq 0 ]; then
    as_root=""
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root="sudo -n"
else
    echo "system-packages: neither root nor sudo without a password; install chromium and chromium-driver by hand"
    exit 0
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
if $as_root apt-get update >"$log" 2>&1 &&
    $as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get -o DPkg::Lock::Timeout=120 install -y --no-install-recommends chromium chromium-driver >>"$log" 2>&1 && present; then
    echo "system-packages: installed chromium and chromium-driver"
else
    echo "system-packages: could not install chromium and chromium-driver: $(tail -n 1 "$log")"
fi
exit 0
