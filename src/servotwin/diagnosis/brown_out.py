"""Whether a board on the supply of a servo browns out, and what would keep it running, tried by simulation."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin import signals
from servotwin.diagnosis.api import step_of_60
from servotwin.errors import InputError, ServotwinError, UnknownNameError
from servotwin.simulation import simulate

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.logs import Log
    from servotwin.models import Model
    from servotwin.signals import Signal

_ROUNDS = 14  # of a search by halves: a part in 16,000 of where it begins
_LEAST_RESISTANCE = 1e-3  # ohm, of a wire
_MOST_CURRENT = 50.0  # A
_SLOWEST = 3.0  # s, of a move that somebody waits for
RESETS, MAY_RESET, RUNS_ON = "resets", "may reset", "runs on"


class Board(NamedTuple):
    """A board: its name, and between which voltages at its 5 V pin it resets [V], with the sources."""

    title: str
    lower: float
    upper: float
    source: str


_AVR = ("brown-out detector of an ATmega328P at BODLEVEL 101, 2.5 to 2.9 V, 2.7 V in the middle (its data sheet, table "
        "BODLEVEL Fuse Coding; the fuses of the board's boot loader), straight at the 5 V pin")
_ESP32 = "brown-out detector of an ESP32, 2.43 to 2.73 V of its 3.3 V (ESP-IDF, CONFIG_ESP_BROWNOUT_DET_LVL)"
BOARDS: Mapping[str, Board] = MappingProxyType({
    "uno": Board("Arduino Uno", 2.5, 2.9, _AVR), "nano": Board("Arduino Nano", 2.5, 2.9, _AVR),
    "esp32": Board("ESP32 board with an AMS1117", 2.43 + 1.1, 2.73 + 1.1, f"{_ESP32}, and 1.1 V that an AMS1117-3.3 "
                   "drops (its data sheet, typical)"),
    "esp32-ldo": Board("ESP32 board with a low-dropout regulator", 2.43 + 0.1, 2.73 + 0.3, f"{_ESP32}, and 0.1 to 0.3 "
                       "V of a low-dropout regulator (assumed)")})
"""By the word of `--board`."""


class Cure(NamedTuple):
    """What keeps a board running: in words, and the least voltage with it [V]; nan where nothing was to simulate."""

    words: str
    voltage: float


@dataclass(frozen=True, kw_only=True)
class BrownOut:
    """Whether a board on the supply of a servo browns out.

    Parameters
    ----------
    board : Board
    voltage, time : float
        Least voltage of the run [V], and when [s].
    log_voltage, log_time : float
        The same of a log; nan where it has none.
    cures : tuple of Cure
        Of a run in which the board may reset; each alone keeps it above the upper end.
    """

    board: Board
    voltage: float
    time: float
    log_voltage: float
    log_time: float
    cures: tuple[Cure, ...]

    @property
    def outcome(self) -> str:
        """What the board does in the run: "resets", "may reset" or "runs on"."""
        return _outcome(self.board, self.voltage)

    @property
    def log_outcome(self) -> str | None:
        """The same in the log; None where no voltage was logged."""
        return None if math.isnan(self.log_voltage) else _outcome(self.board, self.log_voltage)


def _outcome(board: Board, voltage: float) -> str:
    return RESETS if voltage < board.lower else MAY_RESET if voltage < board.upper else RUNS_ON


def brown_out(model: Model, command: Signal | None, board: str, *, load: Load, duration: float,
              log: Log | None = None) -> BrownOut:
    """Return whether a board on the supply of a servo browns out, and what would keep it running.

    Parameters
    ----------
    model : Model
        With a supply.
    command : Signal, optional
        That of the log, or a step of 60° to the middle of the travel, unless given.
    board : str
        A name of `BOARDS`.
    load : Load
    duration : float
        Of the run [s]
    log : Log, optional
        Whose voltage is looked at too.

    Raises
    ------
    InputError, UnknownNameError
        If there is no such board, or the model has no supply.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.datasheet.conditions import on_supply
    >>> weak = st.PulseServo(on_supply(st.load_servo("towerpro-sg90"), st.Supply.of("5V:0.2A")))
    >>> found = brown_out(weak, st.signals.step(-60.0, 60.0, at=0.1, unit="deg"), "uno", load=st.loads.Load(),
    ...                   duration=0.5)
    >>> found.outcome, round(found.voltage, 2)
    ('resets', 1.75)
    """
    if board not in BOARDS:
        raise UnknownNameError("board", board, BOARDS)
    if "bus_voltage" not in model.available:
        raise InputError("--board", got=f"a {type(model).__name__}, which has no supply", allowed="a model with one")
    place = BOARDS[board]
    if command is None:
        command = step_of_60(model) if log is None else log.signal()

    def run(model: Model, command: Signal) -> tuple[float, float]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            result = simulate(model, command, duration=duration, load=load, output_times=[0.0, duration])
        full = float(model.value("supply.open_circuit_voltage"))
        return (full, 0.0) if result.sag is None else (result.sag.voltage, result.sag.time)

    voltage, time = run(model, command)
    cures = () if _outcome(place, voltage) == RUNS_ON else tuple(_cures(model, command, place, run))
    volts = None if log is None else log.measured.get("bus_voltage")
    at = int(np.nanargmin(volts)) if log is not None and volts is not None and np.isfinite(volts).any() else None
    return BrownOut(board=place, voltage=voltage, time=time, cures=cures,
                    log_voltage=math.nan if at is None or volts is None else float(volts[at]),
                    log_time=math.nan if at is None or log is None else float(log.time[at] - log.start))


def _cures(model: Model, command: Signal, board: Board,
           run: Callable[[Model, Signal], tuple[float, float]]) -> list[Cure]:
    """Return what alone keeps a board above the voltage at which it may reset, the least change of each."""
    def on(name: str, value: float) -> float:
        try:
            return run(type(model)(model.servo.replace({name: value})), command)[0]
        except ServotwinError:
            return -math.inf

    found = []
    ohms = model.value_or("supply.internal_resistance", 0.0)
    if ohms > _LEAST_RESISTANCE and on("supply.internal_resistance", _LEAST_RESISTANCE) >= board.upper:
        best = _edge(lambda value: on("supply.internal_resistance", value) >= board.upper, _LEAST_RESISTANCE, ohms)
        found.append(Cure(f"at most {best:.2g} ohm between source and servo: shorter or thicker wires, fresh cells",
                          on("supply.internal_resistance", best)))
    limit = model.value_or("supply.current_limit", math.inf)
    if limit < _MOST_CURRENT and on("supply.current_limit", _MOST_CURRENT) >= board.upper:
        best = _edge(lambda value: on("supply.current_limit", value) >= board.upper, _MOST_CURRENT, limit)
        found.append(Cure(f"a source that gives {best:.2g} A", on("supply.current_limit", best)))
    if (slow := _slower(command)) is not None and run(model, slow(_SLOWEST))[0] >= board.upper:
        best = _edge(lambda value: run(model, slow(value))[0] >= board.upper, _SLOWEST, 0.0)
        found.append(Cure(f"a ramp over {best:.2g} s in place of the step", run(model, slow(best))[0]))
    return [*found, Cure("a supply of its own for the servo, with the grounds joined", math.nan)]


def _edge(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """Return the value nearest to one that does not hold that still does, by halves."""
    for _ in range(_ROUNDS):
        middle = math.sqrt(good * bad) if bad > 0.0 else 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def _slower(command: Signal) -> Callable[[float], Signal] | None:
    """Return what makes a ramp of so many seconds of a single step of angles or pulses; None of another command."""
    table = command.pieces.table
    changes = [piece for piece in table[1:] if piece.start >= 0.0]
    if len(changes) != 1 or command.edges is not None or any(piece.slope or piece.amplitude for piece in table):
        return None
    before, after, at = float(table[0].value), float(changes[0].value), float(changes[0].start)
    unit = {"angle": "rad", "pulse_width": "s"}.get(command.kind)
    if unit is None:
        return None
    return lambda over: signals.ramp(before, after, at=at, over=over, unit=unit)
