"""The machine that something is measured or computed on: what it is, and how it rounds."""

import hashlib
import math
import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

PACKAGES = ("numpy", "numba", "llvmlite", "mujoco")


def rounding() -> dict[str, Any]:
    """Return what results depend on to the last bit: what the CPU has, and how its libraries round."""
    from numpy._core._multiarray_umath import __cpu_features__ as features
    numbers = np.random.default_rng(0).uniform(-3.0, 3.0, 4000)
    one = [getattr(math, name)(x) for name in ("exp", "expm1", "sin", "cos", "tanh", "atan") for x in numbers.tolist()]
    one += [getattr(math, name)(abs(x)) for name in ("log", "log1p") for x in numbers.tolist()]
    one += [math.atan2(x, 0.7) + math.pow(abs(x), 1.5) for x in numbers.tolist()]
    many = [getattr(np, name)(numbers) for name in ("exp", "expm1", "sin", "cos", "tanh")]
    many += [np.log(abs(numbers)), abs(numbers) ** 1.5, np.arctan2(numbers, 0.7)]
    return {"machine": platform.machine(), "fma": bool(features.get("FMA3") or features.get("NEON_VFPV4")),
            "libm": digest(np.array(one)), "numpy's functions": digest(np.array(many))}


def digest(values: np.ndarray) -> str:
    """Return the SHA-256 of the bits of some numbers, nan being one number."""
    plain = np.array(values, np.float64)
    plain[np.isnan(plain)] = math.nan
    return hashlib.sha256(plain.astype("<f8").tobytes()).hexdigest()


def about() -> dict[str, Any]:
    """Return date, processor, system and versions."""
    return {"date": datetime.now(UTC).date().isoformat(), "cpu": cpu(), "cores": os.cpu_count(),
            "system": f"{platform.system()} {' '.join(platform.libc_ver())}", "python": platform.python_version(),
            "versions": {package: installed(package) for package in PACKAGES}}


def cpu() -> str:
    """Return the name of the processor, as far as the system tells."""
    try:
        rows = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((row.split(": ")[1] for row in rows if row.startswith("model name")), platform.processor())


def installed(package: str) -> str | None:
    """Return the version of a package, or None where there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
