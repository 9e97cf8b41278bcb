"""The servos in each of MuJoCo's data, and what compiled code asks Python about them."""

from __future__ import annotations

import ctypes
import threading
import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.robots.crews import Crew, Instance
from servotwin.robots.joints_layout import ASK_NEW, ASK_RESET, BLOCK, INSTANCE, OF_EACH, RECORD
from servotwin.robots.mount import Joint

_MOST = 4096  # of MuJoCo's data at once
_FIRST_ROWS = 4096  # of a record
_SERIALS = 2**40  # ticks of servos in one of them
_ASK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)


def goals_in(block: NDArray[np.float64], servos: int) -> NDArray[np.float64]:
    """Return where a block has goals, and whether they were told: a view, shape (2, servos)."""
    first = len(BLOCK) + OF_EACH.index("goal") * servos
    return block[first:first + 2 * servos].reshape(2, servos)


class Harbour:
    """Servos by the addresses of MuJoCo's data that they are in.

    Parameters
    ----------
    joints : sequence of Joint
    crews : sequence of Crew
    dofs : int
        Of the model.

    Attributes
    ----------
    first : Instance
        Servos that are in no data yet.
    table : ndarray of int64
        How many there are, then addresses of data and of words, for compiled code.
    asked : ctypes function
        What compiled code calls.
    error : Exception or None
        What could not be raised there.
    """

    def __init__(self, joints: Sequence[Joint], crews: Sequence[Crew], dofs: int) -> None:
        self._joints, self._crews, self._dofs = joints, crews, dofs
        self.head = len(BLOCK) + len(OF_EACH) * len(joints) + dofs
        self.first = Instance(0, crews, joints, dofs, self.head, 0)
        self._spare: Instance | None = self.first
        self._found: dict[int, Instance] = {}
        self._known: dict[int, weakref.finalize[Any, Any]] = {}
        self._lock, self._made = threading.RLock(), 0
        self.table = np.zeros(1 + 2 * _MOST, np.int64)
        self.asked = _ASK(self._ask)
        self.error: Exception | None = None

    def of(self, data: Any) -> Instance:
        """Return the servos in some data, new ones where another had its place in memory before."""
        address = int(data._address)
        if address not in self._known:
            with self._lock:
                instance = self._found.get(address) or self._new(address)
                goals_in(instance.block, len(self._joints))[:] = 0.0
                self._known[address] = weakref.finalize(data, self._forget, address)
                self._known[address].atexit = False
        return self._found[address]

    def known(self, data: Any) -> Instance | None:
        """Return the servos in some data that was asked for before."""
        address = getattr(data, "_address", None)
        return self._found[address] if address in self._known else None

    def _ask(self, what: int, first: int, second: int) -> int:
        """Answer compiled code, in whatever thread it runs; an error is kept until somebody can be told."""
        try:
            with self._lock:
                if what == ASK_NEW:
                    return int((self._found.get(second) or self._new(second)).words.ctypes.data)
                instance = self._found[first]
                if what == ASK_RESET:
                    instance.reset()
                else:
                    words = dict(zip(RECORD, instance.record_words.tolist(), strict=True))
                    instance.keep(words["row"], 2 * max(words["capacity"], _FIRST_ROWS // 2))
                return 1
        except Exception as error:
            self.error = error
            return 0

    def _new(self, address: int) -> Instance:
        count = len(self._found)
        if count == _MOST:
            raise InputError("data with servos", got=count + 1, allowed=f"up to {_MOST} at once: make a new ServoDrive")
        instance, self._spare = self._spare, None
        if instance is None:
            instance = Instance(address, self._crews, self._joints, self._dofs, self.head, 0)
        self._made += 1
        instance.address = address
        instance.words[INSTANCE.index("data")] = address
        instance.words[INSTANCE.index("serial")] = self._made * _SERIALS
        self._found[address] = instance
        self.table[1 + 2 * count:3 + 2 * count] = address, instance.words.ctypes.data
        self.table[0] = count + 1
        return instance

    def _forget(self, address: int) -> None:
        """Give up the servos in data that is no more."""
        with self._lock:
            self._known.pop(address, None)
            if self._found.pop(address, None) is None:
                return
            count = len(self._found)
            rows = self.table[1:].reshape(-1, 2)
            k = int(np.argmax(rows[:count + 1, 0] == address))
            rows[k] = rows[count]
            self.table[0] = count
