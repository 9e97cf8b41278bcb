"""Where MuJoCo keeps what the servos read: looked up once in the library that is loaded, whatever its version."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from servotwin.errors import MissingExtraError, ServotwinError
from servotwin.robots.servos.joints_layout import FUNCTIONS, PLACES

_ODD, _ODD_TOO = 1234.567890123456789, 9876.54321012345678  # numbers that stand nowhere else
_INSIDE = {"time": _ODD, "energy": _ODD_TOO}  # of the data's own memory; all else is behind addresses in it
_CHUNK, _MOST = 256, 1 << 20  # words
_BEHIND = 40, 80  # bytes behind the beginning of `opt.o_friction` among which the integrator is
_PROBE = """<mujoco><size nuserdata="1"/><option timestep="0.001"/><worldbody><body><freejoint/><geom size=".1"/></body>
<body pos="1 0 0"><joint name="a" axis="0 1 0"/><geom size=".1" pos="0 0 .1"/></body></worldbody>
<actuator><motor joint="a"/></actuator></mujoco>"""


class Places(NamedTuple):
    """Bytes behind the beginning of MuJoCo's structs, and addresses in its library.

    `wide` says whether sizes have eight bytes; `slot` is where the control callback stands.
    """

    data: Mapping[str, int]
    timestep: int
    integrator: int
    wide: bool
    functions: Mapping[str, int]
    slot: int


def load_mujoco() -> Any:
    """Return the package.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingExtraError("mujoco", "robots") from None
    return mujoco


@cache
def places() -> Places:
    """Look up where everything is, in a small model.

    Raises
    ------
    MissingExtraError
        If MuJoCo is not installed.
    ServotwinError
        If it is one whose memory is laid out in another way.
    """
    mujoco = load_mujoco()
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time, data.energy[:] = _ODD, _ODD_TOO
    wanted = {name: getattr(data, name).ctypes.data for name in PLACES if name not in _INSIDE}
    wanted |= {name: struct.unpack("q", struct.pack("d", value))[0] for name, value in _INSIDE.items()}
    found = _behind(data._address, wanted)
    option = model.opt
    option.timestep = _ODD
    within = model.opt.gravity.ctypes.data - model._address
    words = np.ctypeslib.as_array((ctypes.c_double * (within // 8)).from_address(model._address))
    at = np.flatnonzero(words == _ODD)
    integrator = _integrator(mujoco, model)
    sizes = np.ctypeslib.as_array((ctypes.c_int64 * 2).from_address(model._address))
    wide = sizes.tolist() == [model.nq, model.nv]
    narrow = sizes.view(np.int32)[:2].tolist() == [model.nq, model.nv]
    library = _library(mujoco)
    if len(found) != len(wanted) or len(at) != 1 or integrator is None or wide == narrow or not all(
            hasattr(library, name) for name in FUNCTIONS):
        raise ServotwinError(f"MuJoCo {mujoco.__version__} keeps its numbers where servotwin does not find them: "
                             "3.12 to 4.0 are known to work")
    functions = {name: ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0 for name in FUNCTIONS}
    slot = ctypes.addressof(ctypes.c_void_p.in_dll(library, "mjcb_control"))
    return Places(found, int(8 * at[0]), integrator, wide, functions, slot)


def _behind(address: int, wanted: Mapping[str, int]) -> dict[str, int]:
    """Return how many bytes behind an address each of some words stands first; it looks no further than it has to."""
    found: dict[str, int] = {}
    for first in range(0, _MOST, _CHUNK):
        words = np.ctypeslib.as_array((ctypes.c_int64 * _CHUNK).from_address(address + 8 * first))
        for name, word in wanted.items():
            at = np.flatnonzero(words == word)
            if name not in found and len(at):
                found[name] = 8 * (first + int(at[0]))
        if len(found) == len(wanted):
            break
    return found


def _integrator(mujoco: Any, model: Any) -> int | None:
    """Return where the number of the integrator stands behind the beginning of a model."""
    first = model.opt.o_friction.ctypes.data + _BEHIND[0]
    numbers = np.ctypeslib.as_array((ctypes.c_int32 * ((_BEHIND[1] - _BEHIND[0]) // 4)).from_address(first))
    follows = np.ones(len(numbers), np.bool_)
    for kind in (mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
                 mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_IMPLICIT):
        model.opt.integrator = kind
        follows &= numbers == int(kind)
    at = np.flatnonzero(follows)
    return int(first + 4 * at[0] - model._address) if len(at) == 1 else None


def _library(mujoco: Any) -> ctypes.CDLL:
    """Return MuJoCo's library, which its package has loaded."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco*.dll"):
        for path in sorted(folder.glob(pattern)):
            return ctypes.CDLL(str(path))
    raise ServotwinError(f"MuJoCo's library is not in {folder}")
