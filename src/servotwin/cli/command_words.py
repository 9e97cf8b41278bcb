"""The command signal out of the options of `servotwin simulate`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from servotwin import signals
from servotwin.cli.numbers import columns_in_si, numbers
from servotwin.errors import CommandError, InputError
from servotwin.signals import Signal

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
_EDGES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}
_WIDTHS = {"pulse_width_us": 1e-6, "pulse_width_ms": 1e-3, "pulse_width_s": 1.0, "pulse_width": 1.0}


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

    step: str | None = None
    ramp: str | None = None
    sine: str | None = None
    chirp: str | None = None
    prbs: str | None = None
    constant: str | None = None
    pulses: Path | None = None
    command: Path | None = None
    unit: str | None = None
    at: float | None = None
    over: float | None = None
    hold: str | None = None
    column: str | None = None

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
                return _pulses(Path(self.pulses or ""))
        return signals.from_csv(Path(self.command or ""), column=self.column, hold=self.hold or "previous")

    def _values(self) -> list[float]:
        forms = {
            "step": ("BEFORE", "AFTER"), "ramp": ("BEFORE", "AFTER"), "constant": ("VALUE",),
            "sine": ("MEAN", "AMPLITUDE", "HZ"), "chirp": ("MEAN", "AMPLITUDE", "HZ_START", "HZ_END"),
            "prbs": ("LOW", "HIGH", "BIT_SECONDS"),
        }
        shape = self.shape
        if shape not in forms:
            return []
        return numbers(f"--{shape}", getattr(self, shape), forms[shape], alone="numbers alone; --unit says the unit")


def _pulses(path: Path) -> Signal:
    edges, widths = columns_in_si(path, _EDGES, _WIDTHS)
    try:
        return signals.pulse_train(edges, widths, unit="s")
    except InputError as error:
        raise CommandError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None
