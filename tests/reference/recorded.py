"""Runs of the slow references that were recorded: the same numbers without the time that they took.

A run is found under a key of its arguments and of the syntax of all that the reference imports, so one that would be
another run is computed. Of those that are there one in forty is computed all the same, and has to be what was recorded.
To record: `RECORD_REFERENCE=FOLDER python3 dev.py validation TESTS`, then `python tests/reference/recorded.py FOLDER`,
which keeps what these tests asked for and nothing else.
"""

from __future__ import annotations

import ast
import base64
import dataclasses
import hashlib
import json
import lzma
import os
import re
import sys
from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
ONE_IN = 40


def encoded(x: Any) -> Any:
    """Return a value in terms of JSON; TypeError for one that is no data."""
    if x is None or isinstance(x, (bool, int, float, str)):
        return x
    if isinstance(x, (np.floating, np.integer)):
        return x.item()
    if isinstance(x, np.ndarray):
        return {"array": base64.b64encode(np.ascontiguousarray(x).tobytes()).decode(), "dtype": x.dtype.str,
                "shape": list(x.shape)}
    if dataclasses.is_dataclass(x) and not isinstance(x, type):
        return _object(x, {one.name: getattr(x, one.name) for one in dataclasses.fields(x)})
    if isinstance(x, tuple) and hasattr(x, "_fields"):
        return _object(x, x._asdict())
    if isinstance(x, (tuple, frozenset)):
        return {"tuple": [encoded(one) for one in (x if isinstance(x, tuple) else sorted(x))]}
    if isinstance(x, list):
        return [encoded(one) for one in x]
    if isinstance(x, dict):
        # In one order: a case that is made of a set has another one in each process.
        return {"dict": [[encoded(key), encoded(x[key])] for key in sorted(x, key=str)]}
    raise TypeError(type(x).__name__)


def _object(x: Any, fields: dict[str, Any]) -> dict[str, Any]:
    return {"of": f"{type(x).__module__}:{type(x).__qualname__}",
            "with": {name: encoded(value) for name, value in fields.items()}}


def decoded(x: Any) -> Any:
    """Return the value again; classes are those of this package alone."""
    if isinstance(x, list):
        return [decoded(one) for one in x]
    if not isinstance(x, dict):
        return x
    if "array" in x:
        return np.frombuffer(base64.b64decode(x["array"]), x["dtype"]).reshape(x["shape"]).copy()
    if "tuple" in x:
        return tuple(decoded(one) for one in x["tuple"])
    if "dict" in x:
        return {decoded(key): decoded(value) for key, value in x["dict"]}
    module, name = x["of"].split(":")
    if not module.startswith("reference."):
        raise ValueError(f"{x['of']} is no class of the references")
    return getattr(import_module(module), name)(**{field: decoded(value) for field, value in x["with"].items()})


@cache
def syntax(module: str) -> str:
    """Return a short name for a reference and all of this package that it imports, comments apart."""
    waiting, seen = [module], set()
    while waiting:
        name = waiting.pop()
        path = HERE / f"{name}.py"
        if name not in seen and name != "recorded" and path.exists():
            seen.add(name)
            text = path.read_text(encoding="utf-8")
            waiting += re.findall(r"^from \. ?(?:import )?(\w+)", text, re.MULTILINE)
    texts = [ast.dump(ast.parse((HERE / f"{name}.py").read_text(encoding="utf-8"))) for name in sorted(seen)]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


@cache
def runs(module: str) -> dict[str, Any]:
    """Return what was recorded of a reference."""
    path = HERE / "recorded" / f"{module}.json.xz"
    return json.loads(lzma.decompress(path.read_bytes())) if path.exists() else {}


def recorded(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let a function of a reference return what was recorded of the same call, where there is that."""
    module = function.__module__.rpartition(".")[2]

    @wraps(function)
    def found(*arguments: Any, **named: Any) -> Any:
        try:
            said = json.dumps([function.__qualname__, syntax(module), encoded(arguments), encoded(named)])
        except TypeError:  # a function among the arguments
            return function(*arguments, **named)
        key = hashlib.sha256(said.encode()).hexdigest()[:20]
        folder, known = os.environ.get("RECORD_REFERENCE"), runs(module).get(key)
        if known is not None and int(key, 16) % ONE_IN:
            result = decoded(known)
        else:
            result = function(*arguments, **named)
            if known is not None:
                _same(encoded(result), known, key)
        if folder:
            _keep(Path(folder) / f"{module}.jsonl", key, result)
        return result

    return found


def _keep(path: Path, key: str, result: Any) -> None:
    line = json.dumps([key, encoded(result)]) + "\n"
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.write(handle, line.encode())  # at once: two processes record
    os.close(handle)


def _same(now: Any, then: Any, key: str) -> None:
    """Raise if a run is not what was recorded, but for what another processor rounds otherwise."""
    numbers = [np.array([x for x in _numbers(one)]) for one in (now, then)]
    if len(numbers[0]) != len(numbers[1]) or not np.allclose(*numbers, rtol=1e-6, atol=1e-8, equal_nan=True):
        raise AssertionError(f"the reference gives another run than was recorded ({key})")


def _numbers(x: Any) -> list[float]:
    if isinstance(x, dict):
        if "array" in x:
            return np.frombuffer(base64.b64decode(x["array"]), x["dtype"]).astype(float).ravel().tolist()
        return [number for one in x.values() for number in _numbers(one)]
    if isinstance(x, list):
        return [number for one in x for number in _numbers(one)]
    return [float(x)] if isinstance(x, (int, float)) else []


def pack(folder: Path) -> None:
    """Put what was recorded into the files of this package, in the place of what was there."""
    (HERE / "recorded").mkdir(exist_ok=True)
    for path in sorted(folder.glob("*.jsonl")):
        rows = dict(json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
        content = lzma.compress(json.dumps(dict(sorted(rows.items()))).encode(), preset=9)
        (HERE / "recorded" / f"{path.stem}.json.xz").write_bytes(content)
        print(f"{path.stem}: {len(rows)} runs, {len(content) / 1e6:.1f} MB")


if __name__ == "__main__":
    pack(Path(sys.argv[1]))
