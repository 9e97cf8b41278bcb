"""`diagnose`: which symptoms a servo shows, and which of its numbers makes them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin import signals
from servotwin.datasheet import thermal_masses
from servotwin.diagnosis.causes import Strength, Trials, finest_of, patient_of, ranked
from servotwin.diagnosis.symptoms import SYMPTOMS, angle_of, looked_at, of_log, of_run
from servotwin.errors import InputError, ServotwinError, UnknownNameError
from servotwin.loads import as_load
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive, default_model, mid_travel
from servotwin.parameters import Servo
from servotwin.simulation import Simulator, simulate
from servotwin.simulation.simulator import simulated
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.diagnosis.causes import Cause, Patient
    from servotwin.diagnosis.symptoms import Judged, Record, Symptom
    from servotwin.loads import Load, Part
    from servotwin.logs import Log
    from servotwin.models import Model
    from servotwin.signals import Signal


# --- `diagnose`: which symptoms a servo shows, and which of its numbers makes them ------------------------------------

_WIDE, _SMALL = math.radians(60.0), math.radians(3.0)
_AT, _LATER = 0.1, 2.0  # s
_OTHERS = (math.radians(-7.3), math.radians(4.1))  # targets beside the middle, where a buzz has to be gone too
_DURATION = 6.0  # s
_TRIPS_BY = 2.0  # s longer than the protection waits
_NEAR = 0.5  # assumed: of a threshold, from where on a symptom is near


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A symptom, and what makes it.

    Parameters
    ----------
    symptom : Symptom
        Row of `SYMPTOMS`.
    run, log : Judged or None
        How strong it is in the run, and in the log; None without a log.
    command : str
        Of the run that shows it: "wide", "small" or "given".
    record : Record
        Of that run.
    causes : tuple of Cause
        The likeliest first.
    pair : tuple of Cause, optional
        Two that only act together: neither alone cures.
    """

    symptom: Symptom
    run: Judged
    log: Judged | None
    command: str
    record: Record
    causes: tuple[Cause, ...]
    pair: tuple[Cause, Cause] | None

    @property
    def together(self) -> tuple[Cause, ...]:
        """The causes of which each is unusual, and without any of which the symptom is gone; empty unless several."""
        odd = tuple(each for each in self.causes if each.cures and each.odd > 1.0)
        return odd if len(odd) > 1 else ()


class Measured(NamedTuple):
    """How strong a symptom is, found or not.

    Parameters
    ----------
    symptom : Symptom
        Row of `SYMPTOMS`.
    run, log : Judged or None
        In the run that shows most of it, and in the log; None without a log. Of a log it is what is certain beside its
        noise.
    """

    symptom: Symptom
    run: Judged
    log: Judged | None

    @property
    def near(self) -> bool:
        """Whether run or log come to half of the threshold or more."""
        return any(each is not None and each.value > _NEAR * each.limit for each in (self.run, self.log))


class Looked(NamedTuple):
    """How much of a log was looked at.

    Parameters
    ----------
    seconds, whole : float
        Of how long a log [s].
    stretches : int
        In which its target stands still for half a second or more.
    rests : int
        At the end of how many of them the shaft is at rest, or swings; in the others it is still on its way.
    swing : float
        Smaller fast swings do not stand out from noise; slow ones do, in means of several samples; nan without
        such a stretch [rad].
    """

    seconds: float
    whole: float
    stretches: int
    rests: int
    swing: float


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The symptoms of a servo.

    Parameters
    ----------
    model : Model
    findings : tuple of Finding
        Empty where no symptom passes its threshold.
    log_only : tuple of str
        Symptoms that the log shows and the servo does not.
    untold : tuple of str
        Symptoms that neither run nor log can show.
    measured : tuple of Measured
        All symptoms.
    looked : Looked or None
        How much of the log was looked at; None without one.
    """

    model: Model
    findings: tuple[Finding, ...]
    log_only: tuple[str, ...]
    untold: tuple[str, ...]
    measured: tuple[Measured, ...]
    looked: Looked | None


def diagnose(servo: Model | Servo, command: Signal | None = None, *, load: Load | Part | None = None,
             duration: float | None = None, log: Log | None = None, seed: int = 0) -> Diagnosis:
    """Return why a servo buzzes, sags, overshoots, gets warm, trips or does not move.

    The symptoms are looked for in a run. Then each number of a table, `diagnosis.causes.NUMBERS`, is brought to what is
    usual, or away altogether, alone, and the run is repeated.

    Parameters
    ----------
    servo : Servo or Model
        A servo that holds an angle behind a bridge.
    command : Signal, optional
        A step of 60° to the middle of the travel, and one of 3° from there, unless given.
    load : Load, optional
        Nothing unless given; of a log its own.
    duration : float, optional
        Of the run; unless given 6 s, or more where a protection waits longer. Of a log, how much of it is looked at,
        all unless given [s].
    log : Log, optional
        Symptoms are looked for in it too; the run then has its command.
    seed : int
        Of the noise of the potentiometer.

    Raises
    ------
    InputError
        If the model is another, or turns without end, or there are both a command and a log.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-422").replace({"electronics.stretcher_gain": 3000.0})
    >>> found = diagnose(servo).findings[0]
    >>> found.symptom.name, found.causes[0].cause
    ('buzzes', 'gain')
    """
    model = default_model(servo) if isinstance(servo, Servo) else servo
    if duration is None:
        duration = _lasts(model) if log is None else log.duration
    _check(model, command, duration, log)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return _diagnosed(model, command, as_load(load), duration, log, seed)


def _lasts(model: Model) -> float:
    if not isinstance(model, DigitalServo):
        return _DURATION
    firmware = model.servo.firmware
    return max(_DURATION, _TRIPS_BY + max(firmware.overload_time or 0.0, firmware.trip_time or 0.0))


def _check(model: Model, command: Signal | None, duration: float, log: Log | None) -> None:
    if not isinstance(model, PulseServo | PulseServoInductive | BoundedServo | DigitalServo) or model.endless:
        raise InputError("model to diagnose", got=model, allowed="a servo that holds an angle behind a bridge")
    if command is not None and log is not None:
        raise InputError("command", got="a command beside a log", allowed="one of them: a log has its own")
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")


def _diagnosed(model: Model, command: Signal | None, load: Load, duration: float, log: Log | None,
               seed: int) -> Diagnosis:
    initial, seen, looked = None, None, None
    if log is not None:
        load, whole = (load if load != as_load(None) else log.load), log.duration
        if duration < whole:
            log = log.part(log.start, log.start + duration)
        command, duration = log.signal(), log.duration
        angle = angle_of(log, model)
        initial = {"output_angle": float(angle[np.isfinite(angle)][0])}
        target = model.command_signal("command_angle", model.command(model.framed(command, duration))(
            log.time - log.start))
        seen = of_log(log, model, target, finest_of(patient_of(model, load)))
        looked = Looked(duration, whole, len(seen.holds), sum(hold.end.rests for hold in seen.holds),
                        seen.noise.swing if seen.holds else math.nan)
    own = command is None or (command.edges is None and command.frame_period is None)
    runs = _Runs(_commands(model, command), duration, seed, initial)
    return _judged(patient_of(model, load, own_frames=own), runs, seen, looked)


def _judged(patient: Patient, runs: _Runs, seen: Record | None, looked: Looked | None) -> Diagnosis:
    """Return which symptoms the runs of a patient show, each with its causes, beside those of a log."""
    finest = finest_of(patient)
    records = {name: runs.record(patient, name, finest) for name in runs.commands if name in _SHOWN}
    masses = thermal_masses(patient.model.servo)
    findings, log_only, untold, measured = [], [], [], []
    hidden: set[tuple[str, str]] = set()
    hidden_in_log: set[str] = set()
    for symptom in SYMPTOMS:
        judged = {name: symptom.judge(record, masses) for name, record in records.items()
                  if name != "small" or symptom.name == "does not move"}
        name = max(judged, key=lambda each: -math.inf if math.isnan(judged[each].value) else judged[each].value)
        in_log = None if seen is None else symptom.judge(seen, masses)
        measured.append(Measured(symptom, judged[name], in_log))
        shows = in_log is not None and in_log.found
        if judged[name].found and (name, symptom.name) not in hidden:
            causes, pair = ranked(Trials(patient, runs.strength(symptom, name, finest)))
            findings.append(Finding(symptom=symptom, run=judged[name], log=in_log, command=name, record=records[name],
                                    causes=tuple(causes), pair=pair))
            hidden |= {(name, each) for each in symptom.hides}
            hidden_in_log |= set(symptom.hides) if shows else set()
        elif shows and symptom.name not in hidden_in_log:
            log_only.append(symptom.name)
        if math.isnan(judged[name].value) and (in_log is None or math.isnan(in_log.value)):
            untold.append(symptom.name)
    return Diagnosis(model=patient.model, findings=tuple(findings), log_only=tuple(log_only), untold=tuple(untold),
                     measured=tuple(measured), looked=looked)


def step_of_60(model: Model) -> Signal:
    """Return a step of 60° to the middle of the travel."""
    middle = mid_travel(model)
    return signals.step(middle - _WIDE, middle, at=_AT, unit="rad")


def _commands(model: Model, command: Signal | None) -> dict[str, Signal]:
    if command is not None:
        return {"given": command}
    middle = mid_travel(model)
    return {"wide": step_of_60(model),
            "small": signals.step(middle, middle + _SMALL, at=_LATER, unit="rad"),
            **{f"wide {k}": signals.step(middle + there + math.copysign(_WIDE, there), middle + there, at=_AT,
                                         unit="rad") for k, there in enumerate(_OTHERS)}}


_SHOWN = ("given", "wide", "small")  # commands whose runs show symptoms


class _Runs:
    """Runs of patients under the commands of one diagnosis."""

    def __init__(self, commands: dict[str, Signal], duration: float, seed: int,
                 initial: dict[str, float] | None) -> None:
        self.commands, self._duration, self._seed, self._initial = commands, duration, seed, initial

    def record(self, patient: Patient, name: str, finest: float) -> Record:
        simulator, command = Simulator(patient.model, patient.load, self._seed), self.commands[name]
        run = simulated(simulator, patient.model.framed(command, self._duration), self._duration,
                        looked_at(self._duration), self._initial).raise_if_failed()
        return of_run(run, finest, from_rest=self._initial is None)

    def strength(self, symptom: Symptom, name: str, finest: float) -> Callable[[Patient], Strength]:
        """Return what tells how strong a symptom is; a buzz, which hangs by a hair, after other steps too."""
        others = [each for each in self.commands if each not in _SHOWN and symptom.name == "buzzes"]

        def of(patient: Patient) -> Strength:
            masses, worst = thermal_masses(patient.model.servo), Strength(-math.inf, 0.0)
            for each in (name, *others):
                worst = max(worst, Strength(*symptom.judge(self.record(patient, each, finest), masses)))
                if worst.value > worst.limit:
                    break
            return worst
        return of


# --- Whether a board on the supply of a servo browns out, and what would keep it running, tried by simulation ---------

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
    """Remedies for a board: in words, and the least voltage with it [V]; nan where nothing was to simulate."""

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
        """The board in the run: "resets", "may reset" or "runs on"."""
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
        Its voltage is looked at too.

    Raises
    ------
    InputError, UnknownNameError
        If there is no such board, or the model has no supply.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.datasheet.holding import on_supply
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
