"""Attacks that use up: memory, processes, files, descriptors, output, processor time, patience."""

from dubins_traffic.protocols import End
from dubins_traffic.sandbox.attacks.attack import Attack
from dubins_traffic.sandbox.layers import FILES, JUDGE, MEMORY, PROCESSES, RLIMITS, SECCOMP

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
