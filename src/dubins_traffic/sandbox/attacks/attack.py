"""Attacks on a box, each a small program with the layers that must stop it: what they are, and all there are."""

from __future__ import annotations

from dataclasses import dataclass

from dubins_traffic.protocols import End
from dubins_traffic.sandbox.layers import (
    ENVIRONMENT,
    FILES,
    IPC,
    JUDGE,
    MEMORY,
    NETWORK,
    PIDS,
    PROCESSES,
    RLIMITS,
    SECCOMP,
    USERS,
)


@dataclass(frozen=True, slots=True)
class Attack:
    """A program that tries something in a box."""

    name: str
    """What it tries."""
    layers: tuple[str, ...]
    """The layers (`sandbox.layers.NAMES`) of which each stops it alone."""
    source: str
    """Python. It sets `got` to what it has got hold of; whatever it raises has stopped it. `bait` holds what the
    suite has laid out on the host (`suite.Baits`), and `prelude` says what else it may use.
    """
    end: End | tuple[End, ...] = ()
    """How its driving must end, or one of several ways; then it is asked for a command, and may write what it likes
    to `answers`.
    """
    alone: bool = True
    """Whether it gets through once its layers are taken away, whoever runs it: of some calls the kernel has more to
    say.
    """
    limits: tuple[tuple[str, float], ...] = ()
    """Limits that differ from the suite's, by name."""


FORKS = """
made = []
while len(made) < 80:
    child = os.fork()
    if child == 0:
        time.sleep(600); os._exit(0)
    made.append(child)
got = len(made)
"""

FILL = """
read, write = os.pipe()
def full(pair, size=60_000):
    for each in pair:
        each.setblocking(False)
        try:
            while True: each.send(bytes(size))
        except OSError: pass
    return pair
"""

BOMBS = (
    Attack("memory", (MEMORY, RLIMITS, JUDGE), """
held = []
for _ in range(40): held.append(bytearray(os.urandom(1) * (16 << 20)))
got = len(held)
"""),
    Attack("memory of many processes", (MEMORY, JUDGE), """
read, write = os.pipe()
for _ in range(8):
    if os.fork() == 0:
        held = bytearray(b'x' * (64 << 20)); os.write(write, b'.'); time.sleep(600)
while len(got or '') < 8: got = (got or '') + os.read(read, 1).decode()
""", alone=False),
    Attack("memory by mapping", (MEMORY, RLIMITS, JUDGE), """
import mmap
held = [mmap.mmap(-1, 64 << 20) for _ in range(10)]
for each in held:
    for place in range(0, len(each), 4096): each[place] = 1
got = len(held)
"""),
    Attack("memory in sockets", (MEMORY, JUDGE), FILL + """
for _ in range(16):
    if os.fork() == 0:
        held = []
        while True:
            try: held.append(full(socket.socketpair()))
            except OSError: break
        os.write(write, b'.'); time.sleep(600)
while len(got or '') < 16: got = (got or '') + os.read(read, 1).decode()
""", alone=False),
    Attack("memory in large datagrams", (MEMORY, JUDGE), FILL + """
for _ in range(16):
    if os.fork() == 0:
        held = []
        while True:
            try: held.append(full(socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM), 180_000))
            except OSError: break
        os.write(write, b'.'); time.sleep(600)
while len(got or '') < 16: got = (got or '') + os.read(read, 1).decode()
""", alone=False),
    Attack("memory in sockets that are under way", (SECCOMP, MEMORY, JUDGE), FILL + """
import array
for _ in range(16):
    if os.fork() == 0:
        far, near = socket.socketpair()
        for _ in range(40):
            pair = full(socket.socketpair())
            far.sendmsg([b'x'], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array('i', [each.fileno() for each in pair]))])
            for each in pair: each.close()
        os.write(write, b'.'); time.sleep(600)
    time.sleep(0.01)
while len(got or '') < 16:
    said = os.read(read, 1).decode()
    got = (got or '') + said
    if not said: raise OSError('none of them was filled')
""", alone=False),
    Attack("memory in pipes", (MEMORY, JUDGE), FILL + """
for _ in range(40):
    if os.fork() == 0:
        held = []
        while True:
            try: pair = os.pipe()
            except OSError: break
            held.append(pair); os.set_blocking(pair[1], False)
            try:
                while True: os.write(pair[1], bytes(4096))
            except OSError: pass
        os.write(write, b'.'); time.sleep(600)
while len(got or '') < 40: got = (got or '') + os.read(read, 1).decode()
""", alone=False, limits=(("memory", 112 << 20),)),
    Attack("memory in files of its own", (MEMORY, JUDGE), """
held = bytearray(b'x' * (40 << 20))
for name in ('/tmp/big', '/tmp/other'):
    with open(name, 'wb') as file:
        for _ in range(40): file.write(bytes(1 << 20)); file.flush()
time.sleep(1); got = len(held)
""", alone=False, limits=(("memory", 112 << 20), ("files", 96 << 20))),
    Attack("memory in page tables", (MEMORY, RLIMITS, JUDGE), """
import mmap
read, write = os.pipe()
for _ in range(16):
    if os.fork() == 0:
        try:
            held = mmap.mmap(-1, 32 << 30, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | 0x4000)
            for place in range(0, len(held), 2 << 20): held[place]
        except OSError: os._exit(0)
        os.write(write, b'.'); time.sleep(600)
os.close(write)
while len(got or '') < 16:
    said = os.read(read, 1).decode()
    got = (got or '') + said
    if not said: raise OSError('none of them was mapped')
""", alone=False),
    Attack("memory that is locked", (RLIMITS,), "place = ctypes.create_string_buffer(8 << 20); call(149, place, 8 << 20); got = 'locked'", alone=False),
    Attack("processes", (PROCESSES, RLIMITS), FORKS),
    Attack("threads", (PROCESSES, RLIMITS), """
held = []
for _ in range(80):
    held.append(threading.Thread(target=time.sleep, args=(600,), daemon=True)); held[-1].start()
got = len(held)
os.write(answers, b'{"got": "threads"}\\n'); sys.stdin.buffer.readline(); os._exit(0)
"""),
    Attack("a file beyond its limit", (FILES, RLIMITS), """
with open('/tmp/big', 'wb') as file:
    try:
        for _ in range(24): file.write(bytes(1 << 20)); file.flush()
        got = file.tell()
    finally: os.unlink('/tmp/big')
"""),
    Attack("many files beyond the limit", (FILES,), """
made = []
try:
    for number in range(12):
        made.append(f'/tmp/many-{os.getpid()}-{number}')
        with open(made[-1], 'wb') as file: file.write(bytes(2 << 20))
    got = len(made)
finally:
    for each in made: os.unlink(each)
"""),
    Attack("empty files", (JUDGE,), """
names = [f'/tmp/empty-{number}' for number in range(60_000)]
for name in names: open(name, 'w').close()
got = len(names)
"""),
    Attack("a file in shared memory", (FILES, RLIMITS), """
with open('/dev/shm/big', 'wb') as file:
    try:
        for _ in range(24): file.write(bytes(1 << 20)); file.flush()
        got = file.tell()
    finally: os.unlink('/dev/shm/big')
"""),
    Attack("descriptors", (RLIMITS,), "got = len([os.dup(0) for _ in range(500)])"),
    Attack("a core dump", (RLIMITS,), """
import resource
resource.setrlimit(resource.RLIMIT_CORE, (1 << 20, 1 << 20)); got = 'allowed'
""", alone=False),
    Attack("more than the limits of a process", (RLIMITS,), """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (4096, 4096)); got = 'raised'
""", alone=False),
    Attack("processor time", (JUDGE,), "spin(600)", End.OUT_OF_TIME, alone=False),
    Attack("processor time of its children", (JUDGE,), """
for _ in range(3):
    if os.fork() == 0: spin(600)
time.sleep(600)
""", End.OUT_OF_TIME, alone=False),
    Attack("processor time of children that nobody waits for", (JUDGE,), """
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
while True:
    if os.fork() == 0:
        spin(0.005); os._exit(0)
    time.sleep(0.005)
""", (End.OUT_OF_TIME, End.PEER_GARBAGE), alone=False),
    Attack("processor time of children, by a number that is cut", (JUDGE,), """
ignore = ctypes.create_string_buffer(struct.pack('QQQQ', 1, 0x04000000, 0, 0))
call(13, (1 << 32) | 17, ignore, None, 8)
while True:
    if os.fork() == 0:
        spin(0.005); os._exit(0)
    time.sleep(0.005)
""", (End.OUT_OF_TIME, End.PEER_GARBAGE), alone=False),
    Attack("processor time of a thread", (JUDGE,), "threading.Thread(target=spin, args=(600,)).start(); time.sleep(600)", End.OUT_OF_TIME, alone=False),
    Attack("patience", (JUDGE,), "time.sleep(1e6)", End.PEER_SILENT, alone=False, limits=(("wall_seconds", 3.0),)),
    Attack("patience, by stopping itself", (JUDGE,), "os.kill(os.getpid(), signal.SIGSTOP)", End.PEER_SILENT, alone=False, limits=(("wall_seconds", 3.0),)),
    Attack("output", (JUDGE,), """
for _ in range(64): os.write(2, b'x' * 65536)
got = 'printed'
"""),
)  # fmt: skip
"""By what they use up."""


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
    _call("asks for the load and the free memory of the host", """
told = ctypes.create_string_buffer(256); call(99, told)
got = struct.unpack_from('QQQQQQ', told)
"""),
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
    _call("changes its turns of the processor", "os.setpriority(os.PRIO_PROCESS, 0, 19); got = 'set'"),
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


GARBAGE = {
    "brackets": "b'[' * 60_000",
    "nested objects": "b'{\"a\":' * 10_000",
    "a line that is too long": "b'x' * 200_000",
    "zeros": "bytes(1000)",
    "no text": "b'\\xff\\xfe\\xfd'",
    "nothing": "b''",
    "a number alone": "b'7'",
    "a pickle": "__import__('pickle').dumps([0.1, 0.0])",
    "a command of one number": 'b\'{"command": [0.1], "tick": 0}\'',
    "a command of three": 'b\'{"command": [0.1, 0, 0], "tick": 0}\'',
    "truth values": 'b\'{"command": [true, false], "tick": 0}\'',
    "texts": 'b\'{"command": ["0.1", "0"], "tick": 0}\'',
    "an object that says it is a number": 'b\'{"command": [{"__float__": 1}, 0], "tick": 0}\'',
    "a whole number beyond all floats": "b'{\"command\": [' + b'9' * 400 + b', 0], \"tick\": 0}'",
    "a number of 60,000 digits": "b'{\"command\": [' + b'9' * 60_000 + b', 0], \"tick\": 0}'",
    "a tick that has not come": 'b\'{"command": [0.1, 0], "tick": 7}\'',
    "a tick before the first": 'b\'{"command": [0.1, 0], "tick": -1}\'',
    "a tick that is no number": 'b\'{"command": [0.1, 0], "tick": true}\'',
    "a tick with a fraction": 'b\'{"command": [0.1, 0], "tick": 0.0}\'',
    "reports that are none": 'b\'{"command": [0.1, 0], "tick": 0, "reports": [[1, 2]]}\'',
    "too many reports": 'b\'{"command": [0.1, 0], "tick": 0, "reports": [\' + b\'["a","b"],\' * 500 + b\'["a","b"]]}\'',
}
"""Lines that are no answer to tick 0."""

LIES = (
    *(
        Attack(f"says {name}", (JUDGE,), f"os.write(answers, {line} + b'\\n'); time.sleep(600)", End.PEER_GARBAGE, alone=False)
        for name, line in GARBAGE.items()
    ),
    Attack("answers twice", (JUDGE,), "os.write(answers, b'{\"command\": [0.1, 0], \"tick\": 0}\\n' * 2); time.sleep(600)", End.PEER_FLOOD, alone=False),
    Attack("floods", (JUDGE,), "while True: os.write(answers, b'{\"command\": [0.1, 0], \"tick\": 0}\\n' * 1000)", End.PEER_FLOOD, alone=False),
    Attack("closes its output and stays", (JUDGE,), "os.close(answers); os.close(1); time.sleep(600)", End.PEER_SILENT, alone=False, limits=(("wall_seconds", 3.0),)),
    Attack("exits", (JUDGE,), "os._exit(7)", End.PEER_LOST, alone=False),
    Attack("crashes", (JUDGE,), "ctypes.string_at(0)", End.PEER_LOST, alone=False),
    Attack("kills whatever it can", (JUDGE,), """
try: os.kill(-1, signal.SIGKILL)
finally: os.kill(os.getpid(), signal.SIGKILL)
""", End.PEER_LOST, alone=False),
)  # fmt: skip
"""By what they say."""


REACH = (
    Attack("reads a file of the host by its path", (FILES,), "got = bait['secret'] in text(bait['file'])"),
    Attack("reads the seeds of a competition beside it", (FILES,), "got = bait['secret'] in text(bait['folder'] + '/seeds.toml')"),
    Attack("follows a link of its own to a file of the host", (FILES,), """
link = '/tmp/link-' + str(os.getpid())
os.symlink(bait['file'], link)
try: got = bait['secret'] in text(link)
finally: os.unlink(link)
"""),
    Attack("goes up from its folder", (FILES,), "got = bait['secret'] in text('/proc/self/cwd' + '/..' * 9 + bait['file'])"),
    Attack("looks at the root of the first process", (FILES,), "got = bait['secret'] in text('/proc/1/root' + bait['file'])", alone=False),
    Attack("reads the users of the host", (FILES,), "got = 'root' in text('/etc/passwd')"),
    Attack("reads the names of hosts", (FILES,), "got = text('/etc/hosts')"),
    Attack("lists the homes of the host", (FILES,), "got = os.listdir('/home') or True"),
    Attack("lists the host's variable data", (FILES,), "got = os.listdir('/var/lib')"),
    Attack("reads what the hardware is", (FILES,), "got = os.listdir('/sys/class')"),
    Attack("looks for block devices", (FILES,), "got = [name for name in os.listdir('/dev') if name not in {'null', 'zero', 'full', 'random', 'urandom', 'stdin', 'stdout', 'stderr', 'fd', 'shm'}]"),
    Attack("opens a terminal", (FILES,), "got = os.open('/dev/ptmx', os.O_RDWR)"),
    Attack("writes into a folder of the host", (FILES,), "open(bait['open'] + '/left', 'w').close(); got = 'written'"),
    Attack("writes into the system", (FILES,), "open('/usr/left', 'w').close(); os.unlink('/usr/left'); got = 'written'", alone=False),
    Attack("replaces the program that drives it", (FILES,), "open('/own/dubins_traffic/left', 'w').close(); got = 'written'", alone=False),
    Attack("writes where no file is its own", (FILES,), "open('/left', 'w').close(); got = 'written'; os.unlink('/left')", alone=False),
    Attack("connects to a socket in a folder of the host", (SECCOMP, FILES), """
with socket.socket(socket.AF_UNIX) as there:
    there.connect(bait['folder'] + '/socket')
    got = 'connected'
"""),
    Attack("reads the command line of another process", (PIDS,), "got = bait['secret'] in text(f\"/proc/{bait['process']}/cmdline\")"),
    Attack("lists the processes of the host", (PIDS,), "got = str(bait['process']) in os.listdir('/proc')"),
    Attack("reads the environment of another process", (PIDS,), "got = bait['secret'] in text(f\"/proc/{bait['process']}/environ\")", alone=False),
    Attack("reads the environment of the worker", (PIDS,), "got = bait['secret'] in text(f\"/proc/{bait['worker']}/environ\")", alone=False),
    Attack("signals another process", (PIDS,), "os.kill(bait['process'], 0); got = 'reached'", alone=False),
    Attack("signals the worker", (PIDS,), "os.kill(bait['worker'], 0); got = 'reached'", alone=False),
    Attack("reads the memory of the worker", (PIDS,), "got = text(f\"/proc/{bait['worker']}/maps\")", alone=False),
    Attack("lists the connections of the host", (NETWORK,), "got = f\"{bait['port']:04X}\" in text('/proc/net/tcp', 1 << 20)"),
    Attack("lists the sockets of the host", (NETWORK,), "got = bait['abstract'] in text('/proc/net/unix', 1 << 20)"),
    Attack("lists the network's devices", (NETWORK,), "got = [line for line in text('/proc/net/dev').splitlines()[2:] if not line.strip().startswith('lo:') or int(line.split()[1])]"),
    Attack("connects to a service of the host", (SECCOMP, NETWORK), """
with socket.create_connection(('127.0.0.1', bait['port']), 5): got = 'connected'
"""),
    Attack("connects to an abstract socket", (SECCOMP, NETWORK), """
with socket.socket(socket.AF_UNIX) as there:
    there.connect('\\0' + bait['abstract'])
    got = 'connected'
"""),
    Attack("sends a datagram", (SECCOMP,), """
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
    got = there.sendto(b'x', ('127.0.0.1', bait['port']))
""", alone=False),
    Attack("looks up a name", (SECCOMP, NETWORK), "got = socket.getaddrinfo('example.org', 80)", alone=False),
    Attack("lists shared memory of the host", (IPC,), "got = str(bait['shared']) in [word for line in text('/proc/sysvipc/shm', 1 << 20).splitlines() for word in line.split()]"),
    Attack("reads the worker's environment in its own", (ENVIRONMENT,), "got = bait['secret'] in str(os.environ)"),
    Attack("reads the worker's environment in that of the first process", (ENVIRONMENT,), "got = bait['secret'] in text('/proc/1/environ', 1 << 16)"),
    Attack("reads the load of the host", (FILES,), "got = text('/proc/loadavg')"),
    Attack("reads how busy processors, memory and disks of the host are", (FILES,), """
for name in ('stat', 'uptime', 'meminfo', 'vmstat', 'zoneinfo', 'diskstats', 'interrupts', 'softirqs', 'schedstat', 'pressure/cpu'):
    try: got = text('/proc/' + name) or got
    except OSError: pass
if not got: raise OSError('none of them can be read')
"""),
    Attack("reads the name of the host", (FILES,), "got = socket.gethostname() == bait['host']"),
    Attack("locks a file that others see", (SECCOMP,), """
import fcntl
fcntl.flock(os.open('/usr/bin/env', os.O_RDONLY), fcntl.LOCK_EX)
got = 'locked'
"""),
    Attack("locks a part of a file that others see", (SECCOMP,), """
import fcntl
fcntl.lockf(os.open('/usr/bin/env', os.O_RDONLY), fcntl.LOCK_SH)
got = 'locked'
"""),
    Attack("asks who has locked a file that others see", (SECCOMP,), """
import fcntl
got = fcntl.fcntl(os.open('/usr/bin/env', os.O_RDONLY), fcntl.F_GETLK, struct.pack('hhqqi', fcntl.F_RDLCK, 0, 0, 0, 0))
"""),
    Attack("finds a descriptor that it has inherited", (ENVIRONMENT,), """
own = {0, 1, 2, answers}
for name in os.listdir('/proc/self/fd'):
    place = f'/proc/self/fd/{name}'
    if int(name) not in own and os.path.exists(place) and bait['file'] in os.readlink(place): got = name
""", alone=False),
    Attack("leaves a daemon behind", (PIDS,), """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for descriptor in (0, 1, 2, answers): os.close(descriptor)
        os.execv(sys.executable, [sys.executable, '-I', '-S', '-c', 'import time; time.sleep(600)', bait['daemon']])
    os._exit(0)
os.wait()
""", alone=False),
)  # fmt: skip
"""By what they reach for."""
