"""Everything that the report of the paper computes, before any picture is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import bench, signals
from servotwin.bench import ControlSupply
from servotwin.loads import Inertia
from servotwin.models import AveragedServo, BoundedServo, PulseServo
from servotwin.parameters import load_dataset, load_servo
from servotwin.simulation import simulate

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from servotwin.bench import Bench, BenchRun, Comparison, Interval, ModelShares, Shares, Standing, TableFit, TableRow
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.simulation import Result, StepMetrics


# --- The vibration of the paper's first implementation: servo and control circuit on one soft supply, and -------------

SOFT, STIFF = 0.5, 0.02  # ohm; assumed. Four alkaline AA cells have about 0.9, a laboratory supply and its leads 0.02
VIBRATION_STEP_AT, LOOKED_AT, DURATION = 0.1, 1.5, 4.0  # s; the shaft is judged by what it does from LOOKED_AT on
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
    command = signals.step(before, after, at=VIBRATION_STEP_AT, unit="V")
    run = bench.run_on_one_supply(apparatus, command, DURATION, control)
    still = bench.standing(run.result.raise_if_failed(), LOOKED_AT)
    return Stand(run=run, control=control, still=still, off=still.mean - rows[k].target_angle)


# --- Everything that the report of the paper computes, before any picture is drawn ------------------------------------

Progress = Callable[[str, float], None]

SERVO = "hitec-hs-755hb"
LOAD_INERTIA = 1e-3  # kg m²; assumed, the paper does not say what its simulated servo carried
STEP_AT, STEP_DURATION = 0.1, 1.5  # s
APPROACH_ROW, APPROACH, APPROACH_TIME = 2, math.radians(30.0), 5.0  # row of Table II, rad, s; the latter as `measure`
MODELS: Mapping[str, type[Model]] = {"averaged": AveragedServo, "bounded": BoundedServo, "pulse": PulseServo}
LABELS = {"averaged": "averaged servo (the paper's model)", "bounded": "bounded servo", "pulse": "pulse servo"}


@dataclass(frozen=True, eq=False, kw_only=True)
class BenchStudy:
    """One model on the bench: its table, how that differs from the measured one, and how the shaft comes to a stand.

    `approaches` are the motions towards the angle of one row, from below and from above.
    """

    bench: Bench
    rows: tuple[TableRow, ...]
    differences: tuple[Comparison, ...]
    angle_shares: tuple[ModelShares, ...]
    voltage_shares: tuple[ModelShares, ...]
    approaches: tuple[Result, Result]

    @property
    def widest(self) -> float:
        """Largest standing band of all rows [rad]."""
        return max(row.standing_band for row in self.rows)

    @property
    def friction(self) -> float:
        """Largest share of friction, or of creep without end, in it [rad]."""
        return max(row.friction_band for row in self.rows)

    def worst(self, name: str) -> float:
        """Return the largest magnitude of one difference over all rows (SI, counts)."""
        return float(max(abs(getattr(row, name)) for row in self.differences))


@dataclass(frozen=True, eq=False, kw_only=True)
class PaperStudy:
    """All results of the report.

    Parameters
    ----------
    servo : Servo
        Of the catalog.
    table : mapping
        The measured Table II, in its own units.
    ranges : mapping
        Table I.
    steps : mapping
        By model, the response to 0→180°.
    metrics : mapping
        By model.
    peak_voltage : mapping
        By model, the largest magnitude of the armature voltage [V].
    fits : mapping
        The straight lines through Table II.
    measured_shares : tuple of Shares
        Why the measured angles lie off a straight line.
    on_bench : mapping
        By model.
    offsets : Interval
        Zero offsets of the converter that give all five pulse widths [counts].
    vibration : VibrationStudy
        Servo and control circuit on one supply, and apart.
    """

    servo: Servo
    table: Mapping[str, NDArray[np.float64]]
    ranges: Mapping[str, NDArray[np.float64]]
    steps: Mapping[str, Result]
    metrics: Mapping[str, StepMetrics]
    peak_voltage: Mapping[str, float]
    fits: Mapping[str, TableFit]
    measured_shares: tuple[Shares, ...]
    on_bench: Mapping[str, BenchStudy]
    offsets: Interval
    vibration: VibrationStudy

    @property
    def supply(self) -> float:
        """Open-circuit voltage of the supply [V]."""
        return _value(self.servo, "supply.open_circuit_voltage")

    @property
    def friction_torque(self) -> float:
        """Dry friction at the output shaft, the larger of both directions [N m]."""
        return self.value("gear.gear_reduction") * max(
            self.value(f"friction.coulomb_torque_{way}") for way in ("forward", "backward"))

    @property
    def full_torque(self) -> float:
        """The motor's torque at the output shaft, at rest and with all that the supply leaves it [N m]."""
        return (self.value("gear.gear_reduction") * self.value("motor.torque_constant") * self.voltage_limit
                / self.value("motor.armature_resistance"))

    @property
    def shortest_pulse(self) -> float:
        """How long the armature's inductance takes to a current that overcomes friction, at full voltage [s]."""
        delay = self.value("motor.armature_inductance") / self.value("motor.armature_resistance")
        return -delay * math.log1p(-self.friction_torque / self.full_torque)

    @property
    def voltage_limit(self) -> float:
        """The voltage that the supply leaves for the motor, V_oc − V_ce0 [V]."""
        drop = self.servo.get("supply.bridge_drop_voltage")
        return self.supply - (float(drop) if isinstance(drop, int | float) else 0.0)

    @property
    def sheet_seconds_per_60deg(self) -> float | None:
        """Time for 60° in the maker's sheet [s], where the servo file has it."""
        fact = self.servo.sheet.get("speed_per_60deg")
        value = getattr(fact, "value", None) if not isinstance(fact, Mapping) else fact.get("value")
        return float(value) if isinstance(value, int | float) else None

    def value(self, name: str) -> float:
        """Return a parameter of the servo (SI)."""
        return _value(self.servo, name)


def run_study(progress: Progress) -> PaperStudy:
    """Compute everything; `progress` is called with words and a fraction of the whole report."""
    progress("reading the servo and the tables", 0.02)
    servo = load_servo(SERVO)
    table = load_dataset("urrea-kern-table-2").columns
    ranges = load_dataset("urrea-kern-table-1").columns
    progress("simulating the step from 0 to 180°", 0.05)
    steps = {name: _step(model(servo)) for name, model in MODELS.items()}
    progress("fitting straight lines to Table II", 0.10)
    fits = bench.table_fits(table)
    progress("measuring on the simulated bench", 0.15)
    at_bench = bench.bench_servo(servo)
    on_bench = {name: _bench(model(at_bench), table, fits) for name, model in MODELS.items()}
    progress("letting it vibrate on a common supply", 0.20)
    return PaperStudy(
        servo=servo, table=table, ranges=ranges, steps=steps,
        metrics={name: step.step_metrics() for name, step in steps.items()},
        peak_voltage={name: step.peak("armature_voltage") for name, step in steps.items()},
        fits=fits, measured_shares=bench.measured_shares(fits),
        on_bench=on_bench, vibration=run_vibration(at_bench, on_bench["pulse"].rows),
        offsets=bench.zero_offset_interval(table["V_i_V"].tolist(), [1e-6 * t for t in table["t_a_us"].tolist()]))


def _step(model: Model) -> Result:
    command = signals.step(0.0, 180.0, at=STEP_AT, unit="deg")
    return simulate(model, command, duration=STEP_DURATION, load=Inertia(LOAD_INERTIA)).raise_if_failed()


def _bench(model: Model, table: Mapping[str, NDArray[np.float64]], fits: Mapping[str, TableFit]) -> BenchStudy:
    apparatus = bench.Bench(model)
    rows = apparatus.measure(table["V_i_V"])
    return BenchStudy(
        bench=apparatus, rows=rows, differences=bench.compare(rows, table),
        angle_shares=bench.model_shares(rows, fits),
        voltage_shares=bench.model_shares(rows, fits, quantity="feedback_voltage"),
        approaches=(_approach(apparatus, rows[APPROACH_ROW], -APPROACH),
                    _approach(apparatus, rows[APPROACH_ROW], APPROACH)))


def _approach(apparatus: Bench, row: TableRow, away: float) -> Result:
    """Return the motion to the angle of a row from so far away [rad], as the row itself was measured."""
    pulses = signals.constant(row.reading.pulse_width, unit="s", frame_period=apparatus.generator.frame_period)
    return simulate(apparatus.model, pulses, duration=APPROACH_TIME, output_step=4e-3,
                    initial={"output_angle": row.target_angle + away}).raise_if_failed()


def headline_numbers(study: PaperStudy) -> dict[str, float]:
    """Return the numbers of the summary, the unit in each name."""
    numbers: dict[str, float] = {}
    for name, one in study.on_bench.items():
        numbers[f"{name}_worst_angle_deg"] = math.degrees(one.worst("output_angle"))
        numbers[f"{name}_worst_feedback_voltage_mV"] = 1e3 * one.worst("feedback_voltage")
        numbers[f"{name}_worst_pulse_width_us"] = 1e6 * one.worst("pulse_width")
        numbers[f"{name}_worst_feedback_count"] = one.worst("feedback_count")
        numbers[f"{name}_widest_standing_band_deg"] = math.degrees(one.widest)
        numbers[f"{name}_widest_friction_band_deg"] = math.degrees(one.friction)
    for name, metrics in study.metrics.items():
        numbers[f"{name}_rise_time_s"] = metrics.rise_time
        numbers[f"{name}_top_speed_deg_per_s"] = math.degrees(metrics.slew_rate)
        numbers[f"{name}_peak_armature_voltage_V"] = study.peak_voltage[name]
    numbers["averaged_peak_voltage_over_supply"] = study.peak_voltage["averaged"] / study.supply
    numbers["bench_pulse_rate_Hz"] = study.on_bench["bounded"].rows[0].reading.pulse_rate
    for circuit in ("common", "separate"):
        still = study.vibration.circuits[circuit].still
        numbers[f"{circuit}_supply_swing_deg"] = math.degrees(still.swing)
        numbers[f"{circuit}_supply_swings_per_s"] = still.frequency
    numbers["converter_offset_lower_counts"], numbers["converter_offset_upper_counts"] = study.offsets
    return {name: round(value, 9) for name, value in numbers.items()}  # 4e-13 µs is rounding and no difference


def _value(servo: Servo, name: str) -> float:
    number = servo.get(name)
    return float(number) if isinstance(number, int | float) else math.nan
