"""Part 9: each form in which lanes run beside the next general one: time of a lane, with the form and with it off.

Of `digital` it is the legs or series by which these go from tick to tick that are off. The next general form of lanes
that go by bands is the leg by leg one of servos with play; that is all servos of the catalog that go by bands, at the
end.

A form stays where a servo of the catalog or a documented load runs in it, and it is over 1.5 times faster.
"""

import sys
import warnings
from pathlib import Path
from unittest.mock import patch

import numpy as np

import servotwin as st
from servotwin.models.engine.batch import tiles
from servotwin.simulation.lanes import forms

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "compile"))
from measure import Recorder, best

DURATION, EVERY, LANES, REPEATED = 2.0, 0.3, 128, 7  # s, s between goals
HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0}
PLAIN = st.loads.Inertia(1e-3)
CASES = (  # a form, and servos that run in it
    ("side_by_side_float64", st.PulseServo, "hitec-hs-755hb", {}, PLAIN),
    ("by_bands", st.PulseServo, "hitec-hs-422", {}, PLAIN),
    ("by_coils", st.PulseServoInductive, "hitec-hs-755hb", {}, PLAIN),
    ("by_gaps", st.PulseServo, "geekservo-2kg", {}, PLAIN),
    ("by_strides", st.PulseServo, "hitec-hs-755hb", HEAT, PLAIN),
    ("by_strides", st.PulseServo, "hitec-hs-755hb", {}, st.loads.Pendulum(mass=0.1, length=0.1)),
    ("by_ticks", st.DigitalServo, "dsservo-ds3218", {}, PLAIN),
    ("by_ticks", st.DigitalServo, "dynamixel-xl330-m077", {}, PLAIN),
    ("digital", st.DigitalServo, "feetech-sts3215-12v", {}, PLAIN),
    ("digital", st.DigitalServo, "feetech-sts3215-12v", HEAT, PLAIN))


def seconds(kind: type, name: str, changes: dict[str, float], load: st.loads.Load, without: str = "") -> float:
    """Return the time of a lane [s], and how it runs; one form may be off."""
    take = forms._take

    def others(terms: object, left: np.ndarray, recipe: object, *wanted: object) -> np.ndarray:
        return np.zeros(0, np.int64) if recipe.name == without else take(terms, left, recipe, *wanted)

    rng, recorder, model = np.random.default_rng(0), Recorder(), kind(st.load_servo(name).replace(changes))
    at = np.arange(0.0, DURATION, EVERY)
    commands = [st.signals.samples(at, rng.uniform(5.0, 45.0, len(at)), unit="deg") for _ in range(LANES)]
    sides = forms.SIDES
    if without == "by_bands":
        sides = sides | {tiles.GAPS: (sides[tiles.GAPS][0], 0)}
    with patch.object(forms, "_take", others), patch.object(forms, "SIDES", sides):
        st.simulate_many(model, commands, duration=DURATION, load=load, executor=recorder, chunk=LANES,
                         parameters={"load.torque": rng.uniform(-0.02, 0.02, LANES)}, output_times=[DURATION])

        def run() -> None:
            for job, arguments in recorder.jobs:
                job(*arguments)
        return best(run, REPEATED) / LANES


def bands_off(name: str) -> float | None:
    """Return how much longer a servo of the catalog takes with bands off; None of one that goes by none."""
    servo = st.load_servo(name)
    try:
        model = st.PulseServo(servo)
    except st.errors.MissingParameterError:  # a digital servo
        return None
    batch = st.simulate_many(model, st.signals.constant(0.1, unit="rad"), duration=0.02, load=PLAIN,
                             parameters={"load.torque": [0.0, 0.01]})
    if set(batch.stats.kernel) != {"by_bands"}:
        return None
    own, off = (seconds(st.PulseServo, name, {}, PLAIN, without) for without in ("", "by_bands"))
    return off / own


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore", UserWarning)
    print(f"{'form':22}{'servo':40}{'lane [us]':>10}{'form off':>10}")
    for form, kind, name, changes, load in CASES:
        own, off = (seconds(kind, name, changes, load, without) for without in ("", form))
        what = name + (", heat" if changes else "") + ("" if load is PLAIN else ", pendulum")
        print(f"{form:22}{kind.__name__ + ' ' + what:40}{1e6 * own:10.1f}{off / own:9.2f}x", flush=True)
    ratios = list(filter(None, map(bands_off, st.catalog_names())))
    print(f"by_bands off, {len(ratios)} servos of the catalog: {min(ratios):.2f} to {max(ratios):.2f}, "
          f"median {np.median(ratios):.2f}; over 1.5: {sum(x > 1.5 for x in ratios)}")


if __name__ == "__main__":
    main()
