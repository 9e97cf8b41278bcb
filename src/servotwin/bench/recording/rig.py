"""What a recorder records from: a bench with its wires, whatever they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from servotwin.bench.recording.experiment import Experiment


class Rig(Protocol):
    """A servo on a wire, with what measures it.

    It is safe to leave: `limp` may be called at any time, from any error, and never raises.
    """

    @property
    def kind(self) -> str:
        """What an experiment for it commands: "pulse_width" or "angle"."""

    @property
    def columns(self) -> Sequence[str]:
        """Columns of its rows, named as those of a log: `time_s`, `pulse_width_us`, `feedback_voltage_V` and more."""

    def open(self) -> object:
        """Take the wire and look who is there; the servo is limp.

        Raises
        ------
        BenchError
            If nobody answers.
        """

    def facts(self) -> Mapping[str, Any]:
        """Return what the sidecar of a log says of it, in plain JSON: firmware, wiring, calibration, registers."""

    def approach(self, value: float) -> None:
        """Go to a command (SI) and wait until the servo stands, at most some seconds."""

    def run(self, experiment: Experiment) -> Iterator[Sequence[float]]:
        """Command an experiment and yield rows as they come, nan where nothing was measured; ends with it.

        The first row's time is 0 or close to it: the instant of the first command. Leaving the iterator early (its
        `close`) leaves the servo with the last command; the recorder calls `limp`.

        Raises
        ------
        BenchError
            If the wire is cut or does not answer.
        """

    def limp(self) -> None:
        """Let the servo go: no pulses, torque off. Never raises; where nobody hears, the bench does it by itself."""

    def close(self) -> None:
        """Give back the wire; the servo is limp then."""
