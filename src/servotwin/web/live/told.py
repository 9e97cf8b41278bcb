"""What a servo is told: a command, which a servo of pulses hears once a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError
from servotwin.models import DigitalServo
from servotwin.models.switched import SwitchedServo
from servotwin.physics.pieces import Piece, Pieces, piece_value
from servotwin.signals import Signal
from servotwin.web.live.commands import command_signal
from servotwin.web.live.control_circuit import ControlCircuit

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.web.live.transmitter import FrameEdge

_NEVER = 1e9  # s


class Taken(NamedTuple):
    """A command that a model takes: as it was given, and as the model follows it."""

    shape: Signal
    drive: Pieces

    def at(self, time: float) -> float:
        """Return what the model follows at a time [s], of plain numbers: it is asked for at each frame."""
        return piece_value(self.drive.at(time)[0], time)


class Told:
    """What a servo is told: a command, which a servo of pulses hears once a frame, and others as it goes.

    Parameters
    ----------
    model : Model
    command : mapping
        The first, as `checked_command` returns it; it begins at t = 0.
    control : mapping, optional
        Of the control circuit that makes the pulses; they are those that the model makes of the command unless given.

    Raises
    ------
    CommandError
        If the model does not take it.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.web.live.transmitter import Transmitter
    >>> hold = {"shape": "hold", "unit": "us", "value": 1500.0}
    >>> told = Told(st.PulseServo(st.load_servo("hitec-hs-755hb")), hold)
    >>> told.hear(Transmitter(50.0, 0).until(0.03)), told.signal.edges
    ([(0.0, 0.0015), (0.02, 0.0015)], (0.0, 0.02))
    """

    def __init__(self, model: Model, command: Mapping[str, Any], control: Mapping[str, float] | None = None) -> None:
        self.pulsed = isinstance(model, SwitchedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)
        if control and not self.pulsed:
            raise InputError("model at a control circuit", got=type(model).__name__, allowed="one of pulses")
        self.control: ControlCircuit | None = None
        """What makes its pulses; None: they are as the command says."""
        self._taken = _taken(model, command, 0.0, controlled=bool(control))
        if control:
            self.control = ControlCircuit(control, float(self._taken.shape(0.0)))
        self.signal = self._silence() if self.pulsed else self._taken.shape
        """What the model follows now."""

    @property
    def widest(self) -> float:
        """The longest pulse that the command may ask for, and what has to follow it [s]; 0 where there are none."""
        if self.control is not None:
            return self.control.longest
        return self._taken.drive.extremes[1] if self.pulsed else 0.0

    def takes(self, model: Model, command: Mapping[str, Any], time: float) -> Taken:
        """Return a command from a time on [s] as a model follows it.

        Raises
        ------
        CommandError, InputError
            If the model, or the control circuit, does not take it.
        """
        return _taken(model, command, time, controlled=self.control is not None)

    def put(self, command: Taken) -> None:
        """Follow another command from its start on, or from the next frame on."""
        self._taken = command
        if not self.pulsed:
            self.signal = command.shape

    @property
    def shape(self) -> Signal:
        """The present command, as it was given."""
        return self._taken.shape

    def fits(self, model: Model) -> Taken:
        """Return the present command for a model with other numbers, for which it may stand for other pulses.

        Raises
        ------
        CommandError
            If that model does not take it.
        """
        return Taken(self._taken.shape, model.command(self._taken.shape))

    def look(self, time: float, bus_voltage: float, full: float) -> None:
        """Let its control circuit read the command at a time [s], off a supply that has a voltage of a full one [V].

        Raises
        ------
        InputError
            If nothing is left of its reference.
        """
        if self.control is not None:
            self.control.look(float(self._taken.shape(time)), 1.0 - bus_voltage / full)

    def hear(self, edges: Sequence[FrameEdge]) -> list[tuple[float, float]]:
        """Take the frames of the time that comes; return edges and widths of their pulses [s], width 0 if lost."""
        if not self.pulsed:
            return []
        made = [(edge, self._width(edge.time)) for edge in edges]
        pulses = [(edge.time, width if edge.sent else 0.0) for edge, width in made]
        sent = [pulse for pulse in pulses if pulse[1] > 0.0]
        if sent:
            rows = self.signal.pieces.table
            before = [(rows[-1].start, rows[-1].value)] if rows[-1].start < sent[0][0] else []
            self.signal = _train([*before, *sent])
        return pulses

    def _width(self, edge: float) -> float:
        return self._taken.at(edge) if self.control is None else self.control.send(edge)

    def _silence(self) -> Signal:
        """Return a train before its first pulse: the servo stands where the command asks for just before t = 0."""
        first = self._taken.at(0.0) if self.control is None else self.control.width
        return _train([(_NEVER, first)])


def _taken(model: Model, command: Mapping[str, Any], time: float, *, controlled: bool) -> Taken:
    shape = command_signal(command, time)
    if controlled and shape.unit != "V":
        raise InputError("unit of a command to a control circuit", got=command["unit"], allowed="V")
    return Taken(shape, model.command(shape))


def _train(pulses: Sequence[tuple[float, float]]) -> Signal:
    return Signal(pieces=Pieces(tuple(Piece(edge, width) for edge, width in pulses)), unit="s", initial=pulses[0][1],
                  edges=tuple(edge for edge, _ in pulses))
