"""A command line that runs in this process, in an empty folder."""

import json
from dataclasses import dataclass

import pytest

from servotwin.cli import main

SERVO = "hitec-hs-755hb"
COMPILES = "servotwin: compiling the kernels"  # said once a machine, by whichever test comes first


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str

    @property
    def data(self):
        return json.loads(self.out)

    @property
    def error(self):
        """The one line of a failure, checked to be one."""
        assert self.code == 2, self.err
        assert self.err.startswith("servotwin: error: "), self.err
        assert self.err.count("\n") == 1, self.err
        assert self.err.endswith("\n")
        assert "Traceback" not in self.err
        return self.err.removeprefix("servotwin: error: ").rstrip("\n")


@pytest.fixture
def cli(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)  # as in a pipe; a runner may set its own

    def run(*words):
        code = main([str(word) for word in words])
        captured = capsys.readouterr()
        said = [line for line in captured.err.splitlines(keepends=True) if not line.startswith(COMPILES)]
        return Ended(code, captured.out, "".join(said))

    return run


@pytest.fixture
def simulate(cli):
    return lambda *words: cli("simulate", SERVO, *words)


@pytest.fixture(scope="session")
def child_environment():
    """For a process of its own: the package is found wherever the tests found it."""
    import os
    from pathlib import Path

    import servotwin

    source = str(Path(servotwin.__file__).parents[1])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)}
