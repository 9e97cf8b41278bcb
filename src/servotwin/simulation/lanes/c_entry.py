"""The entry of a `VectorSimulator` for C: the address of one function that advances by a tick, and its struct."""

from __future__ import annotations

import ctypes
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.simulation.compile.calls import program, tick_address
from servotwin.simulation.compile.layout import GIVEN, HANDLE, MESSAGES, STAGES, TICK, VERSION
from servotwin.simulation.lanes.whole_runs import Piece, piece_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from servotwin.simulation.lanes.store import Store

Array = NDArray[np.float64]
_WORDS: dict[str, Any] = {  # the rest are addresses
    "version": ctypes.c_int64, "lanes": ctypes.c_int64, "duration": ctypes.c_double}


class CTick(ctypes.Structure):
    """`servotwin_tick` of the header: what C hands over at a tick."""

    _fields_: ClassVar[Any] = [(name, _WORDS.get(name, ctypes.c_void_p)) for name in TICK]
    arrays: Mapping[str, NDArray[Any]]


class CEntry:
    """The entry of a `VectorSimulator` for a program in C, which lives for as long as this does.

    Attributes
    ----------
    address : int
        Of the function `int32_t servotwin_advance(servotwin_tick *tick)`.
    lanes : int

    Examples
    --------
    >>> import numpy as np
    >>> import servotwin as st
    >>> sims = st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), lanes=2)
    >>> entry, torque = sims.c_entry(), np.empty(2)
    >>> tick = entry.tick(duration=1e-3, pulse_width=np.array([1.4e-3, 1.6e-3]), load_torque=torque)
    >>> entry.advance(tick)
    >>> "typedef struct servotwin_tick" in entry.header
    True
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self.lanes = store.numbers.count
        self._handle = np.zeros(len(HANDLE), np.int64)
        self._renew = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(self._renewed)
        self._kept: tuple[Any, ...] = ()
        self.address = tick_address()
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(self.address)
        self.refresh()

    @property
    def simulator(self) -> int:
        """Address of the simulator's data for the function."""
        return self._handle.ctypes.data

    @property
    def header(self) -> str:
        """The text of `servotwin.h`."""
        return files("servotwin.simulation").joinpath("servotwin.h").read_text(encoding="utf-8")

    def write_header(self, folder: str | Path) -> Path:
        """Write `servotwin.h` into a folder, over one that is there, and return its path.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        path = Path(folder) / "servotwin.h"
        try:
            path.write_text(self.header, encoding="utf-8")
        except OSError as error:
            raise InputError("write_header(folder)", got=str(folder),
                             allowed=f"a folder that can be written ({error.strerror})") from None
        return path

    def tick(self, duration: float = 0.0, **arrays: NDArray[Any]) -> CTick:
        """Return a struct for this simulator.

        Parameters
        ----------
        duration : float
            Of the tick [s].
        **arrays : ndarray, shape (lanes,)
            By the member's name; the struct keeps them, and reads them when it is used. Others are NULL.

        Raises
        ------
        InputError
            If the duration is no number, there is no such member, or an array is not one of float64 (`status`: int8).
        """
        try:
            tick = CTick(version=VERSION, lanes=self.lanes, duration=duration, simulator=self.simulator)
        except TypeError:
            raise InputError("tick(duration)", got=duration, allowed="a number of seconds") from None
        for name, array in arrays.items():
            if name not in TICK[4:]:
                raise InputError(f"tick({name})", allowed="one of " + ", ".join(TICK[4:]))
            kind = np.int8 if name == "status" else np.float64
            plain = isinstance(array, np.ndarray) and not type(array).__module__.startswith("numpy.ma")
            good = plain and array.dtype == kind and array.shape == (self.lanes,) and array.flags.c_contiguous
            if not (good and (name in GIVEN or array.flags.writeable)):
                allowed = f"an array ({self.lanes},) of {kind.__name__}, its numbers in a row"
                raise InputError(f"tick({name})", got=_told(array),
                                 allowed=allowed if name in GIVEN else f"{allowed}, to write into")
            setattr(tick, name, array.ctypes.data)
        tick.arrays = arrays
        return tick

    def advance(self, tick: CTick) -> None:
        """Call the function, as a program in C would.

        Raises
        ------
        InputError
            If it returns anything but 0; then nothing has changed.
        """
        if not isinstance(tick, CTick):
            raise InputError("advance(tick)", got=tick, allowed="what tick() has returned")
        code = self._function(ctypes.addressof(tick))
        if code != 0:
            raise InputError(f"servotwin_advance returned {code}: {MESSAGES[code]}")

    @property
    def seen(self) -> Array:
        """Signals of the lanes where one is asked for, shape (lanes, signals of `models.engine.observe`)."""
        return self._store.room.seen

    def memory(self) -> tuple[Piece, ...]:
        """Return where all that the lanes remember stands, for who keeps and restores it between ticks.

        It stays there for as long as nothing but ticks, `set` of angles and speeds, `reset` and `restore` happens.
        """
        store = self._store
        arrays = (store.status, store.ended, store.total, store.torque)
        sets = (piece for some in store.sets for piece in some.pieces())
        return (*(piece_of(array) for array in arrays), *sets)

    def commands(self, name: str) -> tuple[Array, Array]:
        """Return the lowest and highest command of each lane, of the kind `name`.

        Raises
        ------
        InputError
            If a servo takes none of this kind.
        """
        return self._store.numbers.command_ends(name)

    def travel(self) -> tuple[Array, Array]:
        """Return the stops of each lane [rad]; infinite where there are none."""
        return self._store.numbers.travel()

    def own_inertia(self) -> Array:
        """Return of each lane what turns with the output without its load, the motor included unless it has play."""
        return self._store.numbers.own_inertia()

    # --- what C works on ----------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Bring what C works on up to date, after lanes have been laid out anew."""
        store, room = self._store, self._store.room
        chains = store.programs()
        programs = {stage: program(chains[stage]) for stage in STAGES}
        self._kept = (chains, programs)
        arrays: Mapping[str, NDArray[Any]] = {
            "given": room.given, "has": room.has, "now": store.now, "status": store.status, "shaft": room.shaft,
            "seen": room.seen, "fresh": store.fresh, **programs}
        words = {name: array.ctypes.data for name, array in arrays.items()}
        words |= {"lanes": self.lanes, "renew": ctypes.cast(self._renew, ctypes.c_void_p).value or 0}
        self._handle[:] = [words[name] for name in HANDLE]

    def _renewed(self, _: int) -> int:
        """Lay the lanes out anew where one of them has to run in another way; C calls this, which is rare."""
        self._store.refit(np.arange(self.lanes), True)
        self.refresh()
        return 1


def _told(array: Any) -> str:
    if not isinstance(array, np.ndarray):
        return type(array).__name__
    return f"an array {array.shape} of {array.dtype}"
