"""A process that serves an arm, as people start it."""

import contextlib
import json
import os
import subprocess
import sys


@contextlib.contextmanager
def served(*words):
    """Start `servotwin wire` and give what it says of itself."""
    process = subprocess.Popen([sys.executable, "-m", "servotwin", "wire", *map(str, words), "--json"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    try:
        text = ""
        while not text.rstrip().endswith("}") or text.count("{") != text.count("}"):
            line = process.stdout.readline()
            assert line, process.stderr.read()
            text += line
        yield {**json.loads(text), "process": process}
    finally:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(20)
        process.kill()
        process.stdout.close()
        process.stderr.close()
