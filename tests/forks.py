"""A program that loads its libraries once and answers each line of input in a process of its own."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from contextlib import contextmanager

LOOP = """
for line in sys.stdin:
    child = os.fork()
    if not child:
        answer(line.strip())
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(1)
"""


@contextmanager
def answering(program, timeout=None, **settings):
    """Start a program whose function `answer(line)` prints JSON; yields a function of a line that returns the answer.

    It fails if an answer takes more than `timeout` seconds. The settings are those of the process.
    """
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", program + LOOP], **pipes, **settings) as server:

        def ask(line):
            server.stdin.write(line + "\n")
            server.stdin.flush()
            assert select.select([server.stdout], [], [], timeout)[0], f"no answer to {line} within {timeout} s"
            return json.loads(server.stdout.readline())

        try:
            yield ask
        finally:
            server.kill()
