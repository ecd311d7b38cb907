"""Attacks by what is said: lines that are no command, or not the one that was asked for."""

from dubins_traffic.protocols import End
from dubins_traffic.sandbox.attacks.attack import Attack
from dubins_traffic.sandbox.layers import JUDGE

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
