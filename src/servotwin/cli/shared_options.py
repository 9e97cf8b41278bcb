"""Common options of the commands that run a servo: groups of options as records, and single options."""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, Protocol

import typer

from servotwin.cli import interrupts
from servotwin.errors import CommandError, ParameterError, UnknownNameError

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.parameters.servo import Value
    from servotwin.signals import Signal


# --- How a command that fits continues after a signal, or the time that it was given: with the best so far ------------

class _Fit(Protocol):
    @property
    def interrupted(self) -> bool: ...


@contextlib.contextmanager
def best_kept(*, shown: bool = True) -> Iterator[Callable[[float, str], None]]:
    """Give what shows the progress, and ends the search after an interrupt, with the best so far.

    Before the first step there is no best, and an interrupt ends the process.
    """
    from servotwin.identification.fitting import checks

    with checks.shown(shown) as show, contextlib.ExitStack() as stack:
        ends: list[Callable[[], None]] = []

        def tell(share: float, text: str) -> None:
            show(share, text)
            if share > 0.0 and not ends:
                ends.append(stack.enter_context(interrupts.finishing()))
            for check in ends:
                check()

        yield tell


def end_if_stopped(fit: _Fit, *, timed: bool) -> None:
    """End the command as an interrupt does, where one has stopped the fit; `timed` is whether its time was limited.

    Raises
    ------
    typer.Exit
    """
    if fit.interrupted and (not timed or interrupts.noted()):
        raise typer.Exit(interrupts.code())


# --- Servo and model out of the words of an argument SERVO and the options `--model` and `--set` ----------------------

def class_of(name: str, among: Sequence[str] | None = None) -> type[Model]:
    """Return the class of a model by the name that `--model` has for it.

    Parameters
    ----------
    name : str
    among : sequence of str, optional
        Names that are allowed; all unless given.

    Raises
    ------
    UnknownNameError
        If there is none of this name.

    Examples
    --------
    >>> class_of("pulse").__name__
    'PulseServo'
    """
    from servotwin.models import MODELS

    if name not in (among or MODELS):
        raise UnknownNameError("model", name, among or MODELS)
    return MODELS[name]


def model_of(servo: str, name: str | None, change: Sequence[str], among: Sequence[str] | None = None,
             register: Sequence[str] = (), supply: str | None = None, assumed: Sequence[str] = ()) -> Model:
    """Return the model of a servo.

    Parameters
    ----------
    servo : str
        Id in the catalog, or path of a servo file.
    name : str or None
        Of the model; None: the one that stands for this servo.
    change : sequence of str
        Words of `--set`.
    among : sequence of str, optional
        Names that are allowed; all unless given.
    register : sequence of str
        Words of `--register`; they come first.
    supply : str, optional
        Words of `--supply`; what `--set` says comes after it.
    assumed : sequence of str
        Sets of registers that nobody said; those of `--register` go before them.

    Raises
    ------
    ServotwinError
        If servo, model, a register or a changed parameter is not known or not possible.

    Examples
    --------
    >>> model_of("hitec-hs-755hb", "bounded", ["motor.armature_resistance=3.1"])
    BoundedServo('hitec-hs-755hb')
    """
    from servotwin.models import default_model

    kind = None if name is None else class_of(name, among)
    changed = servo_of(servo, change, register, supply, assumed)
    return default_model(changed) if kind is None else kind(changed)


def servo_of(servo: str, change: Sequence[str], register: Sequence[str] = (), supply: str | None = None,
             assumed: Sequence[str] = ()) -> Servo:
    """Return a servo with the registers of `--register`, on the supply of `--supply`, as `--set` changes it.

    Examples
    --------
    >>> servo_of("hitec-hs-755hb", ["motor.armature_resistance=3.1"]).motor.armature_resistance
    3.1
    """
    from servotwin.parameters import load_servo
    from servotwin.parameters.registers.held import register_family_of
    from servotwin.parameters.registers.table import set_registers

    plain = load_servo(servo)
    for name in assumed:
        plain = set_registers(register_family_of(plain), name, plain, assumed=True)
    known = found = with_registers(plain, register)
    if supply is not None:
        from servotwin.datasheet.holding import on_supply
        from servotwin.parameters import Supply

        found = on_supply(found, Supply.of(supply, what="--supply"), source="set by --supply")
    made = found.replace(settings(change), source="set by --set") if change else found
    volts = made.supply.open_circuit_voltage
    if volts is not None and volts != known.supply.open_circuit_voltage:
        _check_sheet(known, volts)
    return made


def _check_sheet(servo: Servo, volts: float) -> None:
    """Warn of a supply far from the maker's sheet; of twice as much simulations themselves do."""
    from servotwin.datasheet.holding import highest_voltage, is_above_sheet, is_below_sheet, lowest_voltage

    most = highest_voltage(servo)
    if is_below_sheet(servo, volts):
        warnings.warn(f"{servo.name}: its sheet begins at {lowest_voltage(servo):g} V, and the supply has {volts:g} V",
                      UserWarning, stacklevel=3)
    if is_above_sheet(servo, volts) and volts <= 2.0 * most:
        warnings.warn(f"{servo.name}: its sheet ends at {most:g} V, and the supply has {volts:g} V", UserWarning,
                      stacklevel=3)


# --- Changed parameters out of the words of `--set` -------------------------------------------------------------------

_AWAY = "none"  # takes a value, or all of a group, away


def settings(words: Sequence[str]) -> dict[str, Value | None]:
    """Return values (SI) by dotted name, None for what is taken away; `Servo.replace` checks whether they are physical.

    Parameters
    ----------
    words : sequence of str
        Such as ``"motor.armature_resistance=3.1ohm"``; a number without unit is in SI. ``"stops.upper_angle=none"``
        takes a value away, ``"stops=none"`` all of its group.

    Raises
    ------
    ParameterError
        If one has no name or no value, or a name comes twice.
    UnknownNameError
        If no parameter has this name.
    InputError
        If a number is none, or its unit measures something else.

    Examples
    --------
    >>> settings(["motor.armature_resistance=3.1", "electronics.deadband=8us", "electronics.off_state=coast"])
    {'motor.armature_resistance': 3.1, 'electronics.deadband': 8e-06, 'electronics.off_state': 'coast'}
    >>> settings(["stops=none"])
    {'stops.lower_angle': None, 'stops.upper_angle': None, 'stops.restitution': None}
    """
    values: dict[str, Value | None] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise ParameterError("--set", got=word, allowed="GROUP.NAME=VALUE, such as supply.open_circuit_voltage=5V, "
                                 "or GROUP=none")
        for each in _names(name, text):
            if each in values:
                got = _AWAY if values[each] is None else values[each]
                raise ParameterError(f"--set {each}", got=f"{got} and {text}", allowed="one value")
            values[each] = _value(each, text)
    return values


def _names(name: str, text: str) -> tuple[str, ...]:
    """Return the parameters that a name means: itself, or where a group is taken away all of it."""
    from dataclasses import fields

    from servotwin.parameters import GROUPS

    if text.lower() != _AWAY or name not in GROUPS:
        return (name,)
    return tuple(f"{name}.{f.name}" for f in fields(GROUPS[name]))


def _value(name: str, text: str) -> Value | None:
    from servotwin.parameters import dimension_of
    from servotwin.units.quantities import quantity

    dimension = dimension_of(name)
    if text.lower() == _AWAY:
        return None
    if dimension == "word":
        return text
    found = tuple(quantity(f"--set {name}", part, dimension, bare=True) for part in text.split(","))
    return found if len(found) > 1 else found[0]


# --- Registers out of the words of `--register` -----------------------------------------------------------------------

_WHOLE = re.compile(r"[+-]?\d+|0[xX][0-9a-fA-F]+")
_FORM = "NAME=VALUE, such as P_Coefficient=16, or the name of a set, such as lerobot"


class Registers(NamedTuple):
    """Words of registers: names of sets, and single values, which go before them.

    Parameters
    ----------
    sets : tuple of str
    values : dict of str to int
    """

    sets: tuple[str, ...]
    values: dict[str, int]


def registers(words: Sequence[str]) -> Registers:
    """Return sets and raw values by name; whether there are such registers is checked when they are set.

    Parameters
    ----------
    words : sequence of str
        Such as ``"P_Coefficient=16"`` or ``"lerobot"``; several in one word are divided by commas.

    Raises
    ------
    ParameterError
        If one has no name or no whole number, or a name comes twice.

    Examples
    --------
    >>> registers(["lerobot,P_Coefficient=32", "ID=0x03"])
    Registers(sets=('lerobot',), values={'P_Coefficient': 32, 'ID': 3})
    """
    sets: dict[str, None] = {}
    found: dict[str, int] = {}
    for word in (part for each in words for part in each.split(",")):
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not name or bool(equals) is not bool(text):
            raise ParameterError("--register", got=word, allowed=_FORM)
        if not equals:
            sets[name] = None
            continue
        if _WHOLE.fullmatch(text) is None:
            raise ParameterError(f"--register {name}", got=text, allowed="a whole number, as it is written into it")
        if name in found:
            raise ParameterError(f"--register {name}", got=f"{found[name]} and {text}", allowed="one value")
        found[name] = int(text, 0) if "x" in text.lower() else int(text)
    return Registers(tuple(sets), found)


def with_registers(servo: Servo, words: Sequence[str]) -> Servo:
    """Return a servo with the registers of its own family that `--register` sets.

    Raises
    ------
    ParameterError
        If the servo has no registers, or a value is not one of theirs.
    UnknownNameError
        If there is no register, or no set, of a name.

    Examples
    --------
    >>> import servotwin as st
    >>> softer = with_registers(st.load_servo("feetech-sts3215-12v"), ["P_Coefficient=16"])
    >>> round(softer.firmware.proportional_gain, 3)
    2.608
    """
    from servotwin.parameters import REGISTER_FAMILIES

    if not words:
        return servo
    given, family = registers(words), servo.sheet.get("registers")
    if family not in REGISTER_FAMILIES:
        raise ParameterError(f"--register for {servo.name}", got=", ".join((*given.sets, *given.values)),
                             allowed="a servo with registers, whose file says registers = "
                             + " or ".join(f'"{name}"' for name in REGISTER_FAMILIES)
                             + " under [sheet]; --set firmware.NAME=VALUE changes any servo")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        for name in given.sets:
            servo = REGISTER_FAMILIES[family](name, servo=servo)
        return REGISTER_FAMILIES[family](given.values, servo=servo) if given.values else servo


# --- Options in the same words: groups as records, and single ones ----------------------------------------------------

COMMAND, PLANT, OUTPUT = "Command (one of)", "Servo and load", "Run and output"  # panels of the help
LOGS = "Logs and servo"

ServoArgument = Annotated[str, typer.Argument(help="Catalog id, or path of a servo file (.toml).")]
SeedOption = Annotated[int, typer.Option(
    metavar="NUMBER", help="Seed for the noise of the potentiometer.", rich_help_panel=PLANT)]
DurationOption = Annotated[float, typer.Option(
    metavar="SECONDS", help="Time to simulate.", rich_help_panel=OUTPUT)]
RegisterOption = Annotated[Sequence[str], typer.Option(
    metavar="NAME=VALUE", help="Write a register of a bus servo (Feetech STS, Dynamixel), such as P_Coefficient=16, or "
    "a set: lerobot, lerobot-gripper; repeatable, or with commas.", rich_help_panel=PLANT)]
LogRegisterOption = Annotated[Sequence[str], typer.Option(
    "--register", metavar="NAME=VALUE", help="Registers that the bus servo had (Feetech STS, Dynamixel), such as "
    "P_Coefficient=16, or a set: lerobot, lerobot-gripper; repeatable, or with commas. Of datasets of an SO-100 or "
    "SO-101 lerobot is assumed unless given.", rich_help_panel=LOGS)]
SUPPLY_FORM = "VOLTS[:OHMS][:AMPERES]"
SUPPLY_HELP = "usb (5 V, 0.5 A), or a voltage with resistance and limit of current, such as 12V:0.1ohm or 5V:0.5A"
SupplyOption = Annotated[str | None, typer.Option(
    metavar=SUPPLY_FORM, help=f"Supply of the servo: {SUPPLY_HELP} (default: its own).", rich_help_panel=PLANT)]
LogSupplyOption = Annotated[str | None, typer.Option(
    "--supply", metavar=SUPPLY_FORM, help=f"Supply that the servo had: {SUPPLY_HELP} (default: its own); a voltage "
    "that a log has beside it comes before.", rich_help_panel=LOGS)]
SchedulerOption = Annotated[str | None, typer.Option(
    metavar="ADDRESS", help="Run on the workers of a dask scheduler, such as tcp://host:8786.", rich_help_panel=OUTPUT)]
_ACCURACY = typer.Option(
    metavar="RADIANS", help="Error that an angle may have where a motion is integrated, from 1e-13 to 1e-4 rad.",
    rich_help_panel=OUTPUT)
AccuracyOption = Annotated[float, _ACCURACY]
UsualAccuracyOption = Annotated[float | None, _ACCURACY]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=OUTPUT)]
JsonOption = Annotated[bool, typer.Option(
    "--json", help="Print the summary as JSON, in SI units.", rich_help_panel=OUTPUT)]


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a command ends: what it does with files that exist, and the form of what it prints."""

    force: ForceOption = False
    as_json: JsonOption = False


@dataclass(frozen=True, kw_only=True)
class Plant:
    """The options that say what a servo is and what hangs on it, as they were typed."""

    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="digital, pulse, pulse-inductive or bounded (default: by the kind of the servo).",
        rich_help_panel=PLANT)] = None
    load: Annotated[Sequence[str], typer.Option(
        metavar="PART=VALUE", help="Load on the shaft, as in servotwin simulate.", rich_help_panel=PLANT)] = ()
    change: Annotated[Sequence[str], typer.Option(
        "--set", metavar="GROUP.NAME=VALUE", help="Change a parameter; repeatable.", rich_help_panel=PLANT)] = ()
    register: RegisterOption = ()
    supply: SupplyOption = None

    def of(self, servo: str, among: Sequence[str] | None = None) -> Model:
        """Return the model of a servo (see `model_of`)."""
        return model_of(servo, self.model, self.change, among, self.register, self.supply)

    def load_on(self, model: Model) -> Load:
        """Return what hangs on a servo."""
        from servotwin.cli.option_values import load_from

        return load_from(self.load, model)


@dataclass(frozen=True, kw_only=True)
class LoggedServo:
    """The options that say what the servo of a log was, as they were typed."""

    change: Annotated[Sequence[str], typer.Option(
        "--set", metavar="GROUP.NAME=VALUE", help="Change a parameter of the servo first; repeatable; with a unit, or "
        "in SI units.", rich_help_panel=LOGS)] = ()
    register: LogRegisterOption = ()
    supply: LogSupplyOption = None


_DEFAULT_UNIT = "deg"
_DEFAULT_AT = 0.1  # s: late enough that a plot shows what was before
_SHAPES = ("step", "ramp", "sine", "chirp", "prbs", "constant", "pulses", "command")
# option -> shapes that it belongs to
_BELONGS = {
    "unit": ("step", "ramp", "sine", "chirp", "prbs", "constant"),
    "at": ("step", "ramp"),
    "over": ("ramp",),
    "hold": ("command",),
    "column": ("command",),
}


@dataclass(frozen=True, kw_only=True)
class CommandWords:
    """The options that say what is commanded, as they were typed; None where they were not.

    Parameters
    ----------
    step, ramp, sine, chirp, prbs, constant : str, optional
        Numbers with colons between them.
    pulses, command : Path, optional
        CSV files.
    unit : str, optional
        Of the numbers; degrees unless given.
    at, over : float, optional
        When a step or ramp begins, and how long a ramp takes [s].
    hold : str, optional
        Between the samples of a file: "previous" or "linear".
    column : str, optional
        Which column of a file of samples, where it has several commands.

    Examples
    --------
    >>> CommandWords(step="0:90").described(1.0)
    'step 0 to 90 deg at 0.1 s'
    """

    step: Annotated[str | None, typer.Option(
        metavar="BEFORE:AFTER", help="Step at time --at.", rich_help_panel=COMMAND)] = None
    ramp: Annotated[str | None, typer.Option(
        metavar="BEFORE:AFTER", help="Ramp that starts at --at and takes --over seconds.",
        rich_help_panel=COMMAND)] = None
    sine: Annotated[str | None, typer.Option(
        metavar="MEAN:AMPLITUDE:HZ", help="Sine.", rich_help_panel=COMMAND)] = None
    chirp: Annotated[str | None, typer.Option(
        metavar="MEAN:AMPLITUDE:HZ:HZ", help="Sine whose frequency changes from the first to the second during the "
        "run.", rich_help_panel=COMMAND)] = None
    prbs: Annotated[str | None, typer.Option(
        metavar="LOW:HIGH:SECONDS", help="Pseudo-random sequence of two values, with the bit time.",
        rich_help_panel=COMMAND)] = None
    constant: Annotated[str | None, typer.Option(
        metavar="VALUE", help="Constant value.", rich_help_panel=COMMAND)] = None
    pulses: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Individual pulses: columns time_s (rising edge), pulse_width_us.",
        rich_help_panel=COMMAND)] = None
    command: Annotated[Path | None, typer.Option(
        metavar="FILE.csv", help="Samples: columns time_s and pulse_width_us, command_angle_deg or command_voltage_V.",
        rich_help_panel=COMMAND)] = None
    unit: Annotated[str | None, typer.Option(
        metavar="UNIT", help="Unit of the command: deg (default), rad, us, ms, s, V or mV.",
        rich_help_panel=COMMAND)] = None
    at: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Start time of a step or ramp (default 0.1).", rich_help_panel=COMMAND)] = None
    over: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Duration of a ramp.", rich_help_panel=COMMAND)] = None
    hold: Annotated[str | None, typer.Option(
        metavar="HOW", help="Between samples of --command: previous (default) or linear.",
        rich_help_panel=COMMAND)] = None
    column: Annotated[str | None, typer.Option(
        metavar="NAME", help="Column of --command to use, if it has several commands.", rich_help_panel=COMMAND)] = None

    @property
    def shape(self) -> str:
        """The one shape that was asked for.

        Raises
        ------
        CommandError
            If none was, or several were, or an option does not belong to it.
        """
        given = [f.name for f in fields(self) if getattr(self, f.name) is not None]
        shapes = [name for name in given if name in _SHAPES]
        everything = ", ".join(f"--{name}" for name in _SHAPES)
        if not shapes:
            raise CommandError(f"no command is given; use one of {everything}")
        if len(shapes) > 1:
            raise CommandError("commands contradict", got=", ".join(f"--{name}" for name in shapes),
                               allowed=f"one of {everything}")
        for name, owners in _BELONGS.items():
            if name in given and shapes[0] not in owners:
                fitting = ", ".join(f"--{owner}" for owner in owners)
                raise CommandError(f"--{name} goes with {fitting}, not with --{shapes[0]}")
        if self.at is not None and self.at < 0.0:
            raise CommandError(f"--at: got {self.at:g}, allowed: 0 s or later")
        if shapes[0] == "ramp" and self.over is None:
            raise CommandError("--ramp needs --over SECONDS, how long it takes")
        return shapes[0]

    @property
    def inputs(self) -> list[Path]:
        """Files that are read."""
        return [path for path in (self.pulses, self.command) if path is not None]

    def described(self, duration: float) -> str:
        """Return the command in words; `duration` [s] is that of the run."""
        unit = self.unit or _DEFAULT_UNIT
        at = _DEFAULT_AT if self.at is None else self.at
        values = [f"{x:zg}" for x in self._values()]
        match self.shape:
            case "step":
                return f"step {values[0]} to {values[1]} {unit} at {at:g} s"
            case "ramp":
                return f"ramp {values[0]} to {values[1]} {unit} from {at:g} s on, over {self.over:g} s"
            case "sine":
                return f"sine {values[0]} ± {values[1]} {unit} at {values[2]} Hz"
            case "chirp":
                return f"chirp {values[0]} ± {values[1]} {unit} from {values[2]} to {values[3]} Hz in {duration:g} s"
            case "prbs":
                return f"random sequence of {values[0]} and {values[1]} {unit}, bits of {values[2]} s"
            case "constant":
                return f"constant {values[0]} {unit}"
            case "pulses":
                return f"pulses of {self.pulses}"
        return f"samples of {self.command}, {self.hold or 'previous'}"

    def signal(self, duration: float) -> Signal:
        """Return the signal for a run of `duration` [s].

        Raises
        ------
        CommandError
            If a number or a file is not usable.
        """
        from servotwin import signals
        from servotwin.cli.option_values import pulses_of

        unit = self.unit or _DEFAULT_UNIT
        at = _DEFAULT_AT if self.at is None else self.at
        values = self._values()
        match self.shape:
            case "step":
                return signals.step(values[0], values[1], at=at, unit=unit)
            case "ramp":
                return signals.ramp(values[0], values[1], at=at, over=self.over or 0.0, unit=unit)
            case "sine":
                return signals.sine(mean=values[0], amplitude=values[1], frequency=values[2], unit=unit)
            case "chirp":
                return signals.chirp(mean=values[0], amplitude=values[1], start_frequency=values[2],
                                     end_frequency=values[3], duration=duration, unit=unit)
            case "prbs":
                return signals.prbs(values[0], values[1], bit_time=values[2], duration=duration, unit=unit)
            case "constant":
                return signals.constant(values[0], unit=unit)
            case "pulses":
                return pulses_of(Path(self.pulses or ""))
        return signals.from_csv(Path(self.command or ""), column=self.column, hold=self.hold or "previous")

    def _values(self) -> list[float]:
        from servotwin.cli.option_values import numbers

        forms = {
            "step": ("BEFORE", "AFTER"), "ramp": ("BEFORE", "AFTER"), "constant": ("VALUE",),
            "sine": ("MEAN", "AMPLITUDE", "HZ"), "chirp": ("MEAN", "AMPLITUDE", "HZ_START", "HZ_END"),
            "prbs": ("LOW", "HIGH", "BIT_SECONDS"),
        }
        shape = self.shape
        if shape not in forms:
            return []
        return numbers(f"--{shape}", getattr(self, shape), forms[shape], alone="numbers alone; --unit says the unit")
