#!/usr/bin/env bash
# Puts a kernel of Debian's into build/kernel, which tests start under QEMU (tests/guest.py), and an initrd for it that sees
# this machine's files. Neither is installed, so that no rights are needed: apt downloads the packages by lists of its own.
# Does nothing where they are, or where QEMU is not. Says in one line where it can't; the status is 0 either way.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=build/kernel
image=linux-image-amd64
# In the order in which they need each other; where one is missing, a newer kernel has it in another of them.
modules="netfs fscache 9pnet virtio_ring virtio virtio_pci_modern_dev virtio_pci_legacy_dev virtio_pci 9pnet_virtio 9p"

if [ -e "$folder/initrd" ] || ! command -v qemu-system-x86_64 >/dev/null 2>&1; then exit 0; fi
if ! command -v apt-get >/dev/null 2>&1; then
  echo "kernel: no apt-get here; tests that need a kernel of their own are left out"
  exit 0
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
log=$scratch/log

fetch() {
  local own=(-o "Dir::State::Lists=$scratch/lists" -o "Dir::Cache=$scratch/cache" -o APT::Sandbox::User=root) name
  mkdir -p "$scratch/lists/partial" "$scratch/cache/archives/partial" "$scratch/tree"
  apt-get "${own[@]}" -o Acquire::Retries=3 update
  name=$(apt-cache "${own[@]}" depends "$image" | awk '$1 == "Depends:" && !n++ { print $2 }')
  [ -n "$name" ] || { echo "there is no package $image" && return 1; }
  (cd "$scratch" && apt-get "${own[@]}" -o Acquire::Retries=3 download "$name" busybox-static)
  for package in "$scratch"/*.deb; do dpkg-deb -x "$package" "$scratch/tree"; done
}

pack() {
  local busybox=$scratch/tree/bin/busybox inside=$scratch/inside name found
  [ -x "$busybox" ] || busybox=$scratch/tree/usr/bin/busybox
  mkdir -p "$inside/new" "$scratch/kernel"
  cp "$busybox" "$inside/busybox"
  echo '#!/busybox sh' >"$inside/init"
  for name in $modules; do
    found=$(find "$scratch/tree" -name "$name.ko*" | head -n 1)
    [ -n "$found" ] || continue
    cp "$found" "$inside/"
    [[ $found != *.xz ]] || "$busybox" unxz "$inside/$name.ko.xz"
    echo "/busybox insmod /$name.ko" >>"$inside/init"
  done
  cat >>"$inside/init" <<'END'
/busybox mount -t 9p -o trans=virtio,version=9p2000.L,cache=loose,msize=262144,ro machine /new
/busybox mount -t devtmpfs dev /new/dev
exec /busybox switch_root /new "$script"
END
  chmod 755 "$inside/init"
  (cd "$inside" && find . | "$busybox" cpio -o -H newc) >"$scratch/kernel/initrd"
  cp "$scratch"/tree/boot/vmlinuz-* "$scratch/kernel/vmlinuz"
  mkdir -p build
  rm -rf "$folder"
  mv "$scratch/kernel" "$folder"
}

set +e # within a condition the shell would go on after what fails
(set -e; fetch; pack) >"$log" 2>&1
status=$?
set -e
if [ "$status" = 0 ]; then
  echo "kernel: $folder holds $image"
else
  echo "kernel: could not get $image: $(tail -n 1 "$log")"
fi
