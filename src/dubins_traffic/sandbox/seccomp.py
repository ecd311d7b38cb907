"""The system calls of a box: an allow-list, made into a filter by libseccomp.

What is not listed fails with EPERM, so that a program that can do without goes on; `clone3`, whose flags no filter can
read, fails with ENOSYS, upon which the C library takes `clone`. A call of another instruction set kills.
"""

from __future__ import annotations

import errno
import os
from functools import cache
from typing import Any, Final

from dubins_traffic.errors import InputError

ALLOWED: Final = """
    read write readv writev pread64 pwrite64 preadv pwritev preadv2 pwritev2 lseek close close_range dup dup2 dup3
    pipe pipe2 open openat openat2 creat access faccessat faccessat2 stat fstat lstat newfstatat statx statfs fstatfs
    readlink readlinkat getcwd chdir fchdir getdents getdents64 mkdir mkdirat rmdir unlink unlinkat rename renameat
    renameat2 link linkat symlink symlinkat truncate ftruncate fallocate fsync fdatasync sync_file_range umask chmod
    fchmod fchmodat utime utimes utimensat futimesat fadvise64 readahead copy_file_range sendfile splice tee
    getxattr lgetxattr fgetxattr listxattr llistxattr flistxattr
    select pselect6 poll ppoll epoll_create epoll_create1 epoll_ctl epoll_wait epoll_pwait epoll_pwait2 eventfd eventfd2
    timerfd_create timerfd_settime timerfd_gettime inotify_init inotify_init1 inotify_add_watch inotify_rm_watch
    mmap munmap mprotect mremap madvise msync mincore brk mlock munlock mlockall munlockall mlock2 membarrier
    rt_sigprocmask rt_sigreturn rt_sigpending rt_sigtimedwait rt_sigsuspend rt_sigqueueinfo sigaltstack
    pause kill tkill tgkill alarm setitimer getitimer
    execve execveat exit exit_group wait4 waitid vfork fork set_tid_address gettid getpid getppid getpgid getpgrp getsid
    setpgid setsid futex futex_waitv set_robust_list get_robust_list rseq restart_syscall arch_prctl
    sched_yield sched_getaffinity sched_setaffinity sched_getparam sched_getscheduler sched_get_priority_max
    sched_get_priority_min getpriority getcpu
    nanosleep clock_nanosleep clock_gettime clock_getres gettimeofday time times timer_create timer_settime
    timer_gettime timer_getoverrun timer_delete
    getuid geteuid getgid getegid getresuid getresgid getgroups getrlimit setrlimit prlimit64 getrusage uname
    getrandom capget recvfrom recvmsg sendto sendmsg shutdown getsockname getpeername getsockopt setsockopt
"""
"""What programs need that compute, read and write files of their own, and begin threads and processes."""

NAMESPACES: Final = 0x7E020080
"""The flags of `clone` for new namespaces: time, mount, cgroup, uts, ipc, user, pid, net."""
BUFFERS: Final = ("inotify_init", "inotify_init1", "sendmsg", "setsockopt")
"""Calls by which the kernel can be made to hold more than is seen."""
FCNTL: Final = (*range(5), *range(8, 15), *range(1024, 1031), 1032, 1034)
"""What `fcntl` may be asked for: no lock, by which boxes could tell each other something over a file that both see."""
PIPE_SIZE: Final = 1031
"""What it may be asked for besides unless `BUFFERS` are kept from a program."""
AF_UNIX: Final = 1
SIGCHLD: Final = 17
SIGNALS: Final = 64
UNKNOWN: Final = -1
"""What libseccomp says of a system call that it does not know."""
IOCTL: Final = {
    "TCGETS": 0x5401, "TIOCGPGRP": 0x540F, "TIOCGWINSZ": 0x5413, "FIONREAD": 0x541B, "FIONBIO": 0x5421,
    "FIONCLEX": 0x5450, "FIOCLEX": 0x5451,
}  # fmt: skip
"""What `ioctl` may be asked for: to look, and to set what belongs to a descriptor."""
PERSONALITY_AS_IT_IS: Final = 0xFFFFFFFF
PRCTL: Final = {
    "PDEATHSIG": 1,
    "GET_DUMPABLE": 3,
    "NAME": 15,
    "GET_NAME": 16,
    "NO_NEW_PRIVS": 38,
    "VMA": 0x53564D41,
}
"""What `prctl` may be asked for; glibc names its arenas."""


@cache
def binding() -> Any:
    """Return the binding of libseccomp; None where it or the library is missing."""
    try:
        import pyseccomp  # pyright: ignore[reportMissingTypeStubs]
    except (ImportError, RuntimeError, OSError):
        return None
    return pyseccomp


@cache
def program(*, counts_children: bool = False, counts_buffers: bool = False) -> bytes:
    """Return the filter as the kernel reads it.

    Parameters
    ----------
    counts_children : bool
        Whether processor time is counted by the clocks of processes: then a program can't have its children forgotten
        as soon as they end, by not caring for SIGCHLD, since their time would be forgotten with them.
    counts_buffers : bool
        Whether memory is counted by what processes hold, and what pipes and sockets may hold in the kernel with it:
        then these keep the sizes that they begin with, each is held by a descriptor (`ProcessClocks.buffers`) and none
        by a message alone, and there are no queues of notices, which nobody could count.

    Raises
    ------
    InputError
        If there is no libseccomp.
    """
    library = binding()
    if library is None:
        raise InputError("can't be loaded", file="libseccomp", expected="libseccomp2 and pyseccomp")
    made = library.SyscallFilter(library.ERRNO(errno.EPERM))
    for name in ALLOWED.split():
        if not (counts_buffers and name in BUFFERS):
            _allow(library, made, name)
    for number in FCNTL if counts_buffers else (*FCNTL, PIPE_SIZE):
        _allow(library, made, "fcntl", library.Arg(1, library.EQ, number))
    _allow(library, made, "clone", library.Arg(0, library.MASKED_EQ, NAMESPACES, 0))
    _allow(library, made, "socketpair", library.Arg(0, library.EQ, AF_UNIX))
    _allow(library, made, "personality", library.Arg(0, library.EQ, PERSONALITY_AS_IT_IS))
    for number in PRCTL.values():
        _allow(library, made, "prctl", library.Arg(0, library.EQ, number))
    if counts_children:
        for number in set(range(1, SIGNALS + 1)) - {SIGCHLD}:
            _allow(library, made, "rt_sigaction", library.Arg(0, library.EQ, number))
    else:
        _allow(library, made, "rt_sigaction")
    for number in IOCTL.values():
        _allow(library, made, "ioctl", library.Arg(1, library.EQ, number))
    made.add_rule(library.ERRNO(errno.ENOSYS), "clone3")
    return _exported(made)


def _allow(library: Any, made: Any, name: str, *conditions: Any) -> None:
    """Add a rule, if this processor has such a call."""
    number = library.resolve_syscall(library.Arch.NATIVE, name)
    if number != UNKNOWN:
        made.add_rule(library.ALLOW, number, *conditions)


def _exported(made: Any) -> bytes:
    read, write = os.pipe()
    with os.fdopen(read, "rb") as source:
        with os.fdopen(write, "wb") as target:
            made.export_bpf(target)
        return source.read()
