"""Attacks by system calls that no controller needs. Numbers are those of x86-64; elsewhere they are other calls."""

from dubins_traffic.sandbox.attacks.attack import Attack
from dubins_traffic.sandbox.layers import SECCOMP, USERS


def _call(name: str, source: str, *, alone: bool = True) -> Attack:
    return Attack(name, (SECCOMP,), source, alone=alone)


CALLS = (
    _call("memfd_create: a file that no limit counts", "got = call(319, b'x', 0)"),
    _call("memfd_secret", "got = call(447, 0)", alone=False),
    _call("io_uring_setup", "got = call(425, 4, ctypes.create_string_buffer(256))", alone=False),
    _call("io_uring_enter", "call(426, 0, 0, 0, 0, None, 0); got = 'entered'", alone=False),
    _call("bpf", "got = call(321, 0, ctypes.create_string_buffer(struct.pack('IIII', 2, 4, 8, 1) + bytes(112)), 72)", alone=False),
    _call("keyctl", "got = call(250, 0, -3, 1)", alone=False),
    _call("add_key", "got = call(248, b'user', b'left', b'x', 1, -2)", alone=False),
    _call("request_key", "got = call(249, b'user', b'left', None, -2)", alone=False),
    _call("userfaultfd", "got = call(323, 1)", alone=False),
    _call("perf_event_open", "got = call(298, ctypes.create_string_buffer(struct.pack('IIQ', 1, 112, 0) + bytes(96)), 0, -1, -1, 0)", alone=False),
    _call("ptrace", "call(101, 0, 0, None, None); got = 'traced'"),
    _call("process_vm_readv", """
own = ctypes.create_string_buffer(b'own'); into = ctypes.create_string_buffer(3)
pair = lambda place: ctypes.create_string_buffer(struct.pack('QQ', ctypes.addressof(place), 3))
got = call(310, os.getpid(), pair(into), 1, pair(own), 1, 0)
"""),
    _call("process_vm_writev", """
own = ctypes.create_string_buffer(3); into = ctypes.create_string_buffer(b'own')
pair = lambda place: ctypes.create_string_buffer(struct.pack('QQ', ctypes.addressof(place), 3))
got = call(311, os.getpid(), pair(into), 1, pair(own), 1, 0)
"""),
    _call("pidfd_open", "got = call(434, os.getpid(), 0)"),
    _call("pidfd_getfd", "got = call(438, call(434, os.getpid(), 0), 0, 0)"),
    _call("kcmp", "call(312, os.getpid(), os.getpid(), 0, 0, 1); got = 'compared'", alone=False),
    _call("personality", "call(135, 0x0040000); got = 'changed'"),
    _call("a socket of the internet", "got = socket.socket(socket.AF_INET)"),
    _call("a socket of the internet, version 6", "got = socket.socket(socket.AF_INET6)", alone=False),
    _call("a raw socket", "got = socket.socket(socket.AF_INET, socket.SOCK_RAW, 1)", alone=False),
    _call("a packet socket", "got = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)", alone=False),
    _call("a netlink socket", "got = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0)"),
    _call("a socket to the kernel's cryptography", "got = socket.socket(socket.AF_ALG, socket.SOCK_SEQPACKET)", alone=False),
    _call("a socket to the hypervisor", "got = socket.socket(socket.AF_VSOCK, socket.SOCK_STREAM)", alone=False),
    _call("a pair of sockets that are not local", "got = socket.socketpair(socket.AF_TIPC, socket.SOCK_STREAM)", alone=False),
    _call("shared memory of System V", "got = call(29, 0, 4096, 0o1600) + 1"),
    _call("semaphores of System V", "got = call(64, 0, 1, 0o1600) + 1"),
    _call("messages of System V", "got = call(68, 0, 0o1600) + 1"),
    _call("a message queue", "got = call(240, b'left', 0o102, 0o600, None)"),
    _call("mounts", "call(165, b'none', b'/tmp', b'tmpfs', 0, None); got = 'mounted'", alone=False),
    _call("mounts by the new calls", "got = call(430, b'tmpfs', 0)", alone=False),
    _call("clones a mount", "got = call(428, -100, b'/', 1)", alone=False),
    _call("unmounts", "call(166, b'/usr', 2); got = 'unmounted'", alone=False),
    _call("pivot_root", "call(155, b'/tmp', b'/tmp'); got = 'turned'", alone=False),
    _call("chroot", "os.chroot('/tmp'); got = 'changed'", alone=False),
    _call("enters another namespace", "call(308, os.open('/proc/self/ns/net', os.O_RDONLY), 0); got = 'entered'", alone=False),
    _call("opens a file by its handle", "got = call(304, 0, ctypes.create_string_buffer(struct.pack('II', 8, 1) + bytes(8)), 0)", alone=False),
    _call("asks for the handle of a file", "call(303, -100, b'/tmp', ctypes.create_string_buffer(struct.pack('II', 64, 0) + bytes(64)), ctypes.create_string_buffer(8), 0); got = 'handle'", alone=False),
    _call("makes a device", "os.mknod('/tmp/device', 0o20666, os.makedev(1, 1)); got = 'made'", alone=False),
    _call("makes a fifo", "os.mkfifo('/tmp/fifo' + str(os.getpid())); got = 'made'; os.unlink('/tmp/fifo' + str(os.getpid()))"),
    _call("watches a file system", "got = call(300, 0, 0)", alone=False),
    _call("becomes root", "os.setresuid(0, 0, 0); got = 'root'", alone=False),
    _call("becomes itself again", "os.setuid(os.getuid()); got = 'changed'"),
    _call("joins other groups", "os.setgroups([0]); got = 'joined'", alone=False),
    _call("sets capabilities", "call(126, ctypes.create_string_buffer(struct.pack('Ii', 0x20080522, 0)), ctypes.create_string_buffer(24)); got = 'set'"),
    _call("gives itself a name for a trusted process", "call(157, 0x59616d61, -1, 0, 0, 0); got = 'set'", alone=False),
    _call("loads a module", "call(313, -1, b'', 0); got = 'loaded'", alone=False),
    _call("reboots", "call(169, 0, 0, 0, None); got = 'answered'", alone=False),
    _call("reads the kernel's messages", "got = call(103, 3, ctypes.create_string_buffer(4096), 4096)", alone=False),
    _call("sets the clock", "call(227, 0, ctypes.create_string_buffer(16)); got = 'set'", alone=False),
    _call("takes swap space", "call(168, b'/tmp'); got = 'taken'", alone=False),
    _call("gets more turns of the processor", "os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0)); got = 'set'"),
    _call("types into the terminal", "import fcntl; fcntl.ioctl(0, 0x5412, b'x'); got = 'typed'", alone=False),
    _call("types into the terminal by a number that is cut", "call(16, 0, 0x100005412, b'x'); got = 'typed'", alone=False),
    _call("a call of 32 bits", """
import mmap
code = mmap.mmap(-1, 4096, prot=7)
code.write(bytes([0x53, 0xB8, 20, 0, 0, 0, 0xCD, 0x80, 0x5B, 0xC3]))
got = ctypes.CFUNCTYPE(ctypes.c_long)(ctypes.addressof(ctypes.c_char.from_buffer(code)))() > 0
""", alone=False),
    _call("a call of the x32 kind", "got = call(0x40000000 | 39)", alone=False),
    Attack("makes a user namespace", (SECCOMP, USERS), "call(272, 0x10000000); got = 'made'"),
    Attack("begins a process in a user namespace", (SECCOMP, USERS), """
child = call(56, 0x10000000 | 17, 0, 0, 0, 0)
if child == 0: os._exit(0)
got = child
"""),
    Attack("begins one by clone3", (SECCOMP, USERS), """
child = call(435, ctypes.create_string_buffer(struct.pack('QQQQQQQQ', 0x10000000, 0, 0, 0, 17, 0, 0, 0)), 64)
if child == 0: os._exit(0)
got = child
"""),
    Attack("runs a program that begins with a namespace", (SECCOMP, USERS), "got = subprocess.run(['unshare', '--user', 'true'], capture_output=True).returncode == 0"),
)  # fmt: skip
"""By call."""
