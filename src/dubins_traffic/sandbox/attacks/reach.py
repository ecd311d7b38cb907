"""Attacks that reach for what is outside of the box: files, processes, the network, the environment."""

from dubins_traffic.sandbox.attacks.attack import Attack
from dubins_traffic.sandbox.layers import ENVIRONMENT, FILES, IPC, NETWORK, PIDS, SECCOMP

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
