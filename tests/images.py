"""Container images for tests, made from nothing: a program that drives, and nothing else."""

from __future__ import annotations

import io
import subprocess
import tarfile
import tempfile
from pathlib import Path

from dubins_traffic.sandbox.images import OPTIONS
from tests.tools import need_programs

SOURCE = r"""#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

static void look(void) {
    const char *places[] = {"/etc/passwd", "/usr", "/root", "/work", "/dev/kmsg", "/dev/null", NULL};
    const char *news[] = {"/new", "/.box/new", "/dev/new", "/etc/new", "/tmp/new", NULL};
    struct rlimit files;
    for (int k = 0; places[k]; k++)
        if (open(places[k], O_RDONLY) >= 0) fprintf(stderr, "reads %s\n", places[k]);
    for (int k = 0; news[k]; k++)
        if (open(news[k], O_CREAT | O_WRONLY, 0600) >= 0) fprintf(stderr, "writes %s\n", news[k]);
    if (socket(AF_INET, SOCK_STREAM, 0) >= 0) fprintf(stderr, "has a socket\n");
    if (memfd_create("x", 0) >= 0) fprintf(stderr, "has a memfd\n");
    getrlimit(RLIMIT_NOFILE, &files);
    fprintf(stderr, "opens %d as %d\n", (int)files.rlim_max, (int)getuid());
}

int main(int count, char **words) {
    char *line = NULL, *found;
    size_t size = 0;
    const char *turn = count > 1 ? words[1] : getenv("TURN") ? getenv("TURN") : "0.1";
    if (!strcmp(turn, "look")) { look(); turn = "0.1"; }
    while (getline(&line, &size, stdin) > 0) {
        if (!strstr(line, "\"frame\"") || !(found = strstr(line, "\"tick\":"))) continue;
        printf("{\"command\": [0.3, %s], \"tick\": %ld}\n", turn, atol(found + 7));
        fflush(stdout);
    }
    return 0;
}
"""


def require() -> None:
    """Leave a test out where no image can be made; in continuous integration it fails."""
    need_programs("podman", "gcc", "strip")


def program(folder: Path) -> Path:
    """Compile the program, which needs no file but itself."""
    (folder / "drive.c").write_text(SOURCE)
    made = folder / "drive"
    subprocess.run(["gcc", "-O1", "-static", "-o", str(made), str(folder / "drive.c")], check=True)
    subprocess.run(["strip", str(made)], check=True)
    return made


def layer(folder: Path, *entries: tarfile.TarInfo, files: dict[str, bytes] | None = None) -> Path:
    """Write an archive of files, and of other entries, that an image is to consist of."""
    made = folder / "layer.tar"
    with tarfile.open(made, "w") as archive:
        for name, data in (files or {}).items():
            member = tarfile.TarInfo(name)
            member.size, member.mode = len(data), 0o700
            archive.addfile(member, io.BytesIO(data))
        for entry in entries:
            archive.addfile(entry)
    return made


def image(folder: Path, source: Path, *changes: str) -> Path:
    """Make an image of the files in an archive, with changes as ``CMD ["/drive"]``, and save it."""
    options = [word for change in changes for word in ("--change", change)]
    made = folder / "image.tar"
    with tempfile.TemporaryDirectory(prefix="dt-") as own:
        command = ["podman", "--root", f"{own}/store", "--runroot", f"{own}/run", *OPTIONS]
        for words in (
            ["import", *options, str(source), "localhost/drive:1"],
            ["save", "-o", str(made), "localhost/drive:1"],
        ):
            subprocess.run([*command, *words], check=True, capture_output=True)
    return made
