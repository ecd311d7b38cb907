"""Runs in a box: drives with a controller in Python, over lines on standard input and output.

Called as ``python shim.py [--path FOLDER]... SPEC``. Standard output becomes standard error before the controller is
loaded, so that what it prints is no message.
"""

from __future__ import annotations

import json
import os
import sys


def main() -> None:
    """Take the standard streams away, then drive."""
    words = sys.argv[1:]
    while words[0] == "--path":
        sys.path.append(words[1])
        del words[:2]
    answers, questions = os.dup(1), os.dup(0)
    os.dup2(2, 1)
    os.close(0)
    os.open(os.devnull, os.O_RDONLY)
    from dubins_traffic.sandbox.driving import Driving

    driving = Driving(words[0])
    with os.fdopen(questions, "rb") as lines:
        for line in lines:
            answer = driving.answer(json.loads(line))
            sys.stdout.flush()
            if answer is not None:
                text = json.dumps(answer, separators=(",", ":"), allow_nan=False)
                os.write(answers, text.encode() + b"\n")
            if driving.done:
                break


if __name__ == "__main__":
    main()
