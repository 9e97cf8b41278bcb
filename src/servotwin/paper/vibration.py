"""The vibration of the paper's first implementation: servo and control circuit on one soft supply, and apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import bench, signals
from servotwin.bench import ControlSupply
from servotwin.models import PulseServo

if TYPE_CHECKING:
    from servotwin.bench import BenchRun, Standing, TableRow
    from servotwin.parameters import Servo

SOFT, STIFF = 0.5, 0.02  # ohm; assumed. Four alkaline AA cells have about 0.9, a laboratory supply and its leads 0.02
STEP_AT, LOOKED_AT, DURATION = 0.1, 1.5, 4.0  # s; the shaft is judged by what it does from LOOKED_AT on
SHOWN_ROW = 2  # of Table II: 90°

SEPARATE = ControlSupply(command_share=0.0)
CIRCUITS: Mapping[str, tuple[str, ControlSupply, float]] = {
    "common": ("one soft supply for both", ControlSupply(), SOFT),
    "separate": ("a supply for each, the servo's as soft", SEPARATE, SOFT),
    "stiff": ("one stiff supply for both", ControlSupply(), STIFF),
    "late": ("one soft supply, the command read 10 ms after the pulse", ControlSupply(sampling_delay=0.01), SOFT),
    "reference": ("one soft supply, the command apart, the converter's reference not",
                  ControlSupply(command_share=0.0, reference_share=1.0), SOFT),
    "ratiometric": ("one soft supply for command and reference", ControlSupply(reference_share=1.0), SOFT),
}
"""By name: words, circuit, internal resistance of the servo's supply [ohm]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stand:
    """A run to an angle of Table II, and how the shaft stands there; `off` is its mean less the target [rad]."""

    run: BenchRun
    control: ControlSupply
    still: Standing
    off: float


@dataclass(frozen=True, eq=False, kw_only=True)
class VibrationStudy:
    """The circuits at one angle, and the first two of them at all angles of Table II.

    Parameters
    ----------
    target : float
        Angle without error in the row that is shown [rad].
    circuits : mapping
        By name, as `CIRCUITS`.
    common, separate : tuple of Stand
        Row by row.
    """

    target: float
    circuits: Mapping[str, Stand]
    common: tuple[Stand, ...]
    separate: tuple[Stand, ...]


def run_vibration(servo: Servo, rows: Sequence[TableRow]) -> VibrationStudy:
    """Return the experiment for a servo on the bench; `rows` are those of its pulses on a supply that does not sag."""
    everywhere = {name: tuple(_stand(servo, rows, k, *CIRCUITS[name][1:]) for k in range(len(rows)))
                  for name in ("common", "separate")}
    circuits = {name: everywhere[name][SHOWN_ROW] if name in everywhere
                else _stand(servo, rows, SHOWN_ROW, control, resistance)
                for name, (_, control, resistance) in CIRCUITS.items()}
    return VibrationStudy(target=rows[SHOWN_ROW].target_angle, circuits=circuits, **everywhere)


def _stand(servo: Servo, rows: Sequence[TableRow], k: int, control: ControlSupply, resistance: float) -> Stand:
    """Return the step to a row from the first one, to the first from the second."""
    apparatus = bench.Bench(PulseServo(servo.replace({"supply.internal_resistance": resistance},
                                                   source="no source: a soft and a stiff supply")))
    before, after = (rows[j].reading.command_voltage for j in (0 if k else 1, k))
    command = signals.step(before, after, at=STEP_AT, unit="V")
    run = bench.run_on_one_supply(apparatus, command, DURATION, control)
    still = bench.standing(run.result.raise_if_failed(), LOOKED_AT)
    return Stand(run=run, control=control, still=still, off=still.mean - rows[k].target_angle)
