"""An exported servo in floats: it moves as in doubles, and nothing but times is a double."""

import shutil
import subprocess

import numpy as np
import pytest

import servotwin as st
from export.c_servo import STRICT
from export.structures import PROGRAM, STRUCTURES, model_of
from export.test_platforms import HERE
from servotwin import export
from servotwin.errors import InputError

ANGLES = HERE / "harness" / "angles.c"
WHOLE = [name for name, structure in STRUCTURES.items()
         if structure.kind is not st.DigitalServo and name not in ("elastic", "flexible")]
COUNT = 0.0015339807878856412  # rad, of 4096 a turn
FIRST = 88172645463325252  # of the random numbers
COMPILER = next((each for each in ("gcc", "clang") if shutil.which(each)), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs gcc or clang")


def angles(name, draw, folder, dtype):
    """Return the angles [rad] of a servo, compiled without a warning."""
    real = {"float64": "double", "float32": "float"}[dtype]
    export.c(model_of(name, draw), STRUCTURES[name].load, name="servo", dtype=dtype).write(folder / dtype)
    widens = () if real == "double" else ("-Wdouble-promotion",)
    subprocess.run([COMPILER, *STRICT, *widens, "-O1", "-c", str(folder / dtype / "servo.c"),
                    "-o", str(folder / dtype / "servo.o")], check=True)
    subprocess.run([COMPILER, f"-DREAL={real}", f"-DSEED={FIRST + draw}u", "-I", str(folder / dtype), str(ANGLES),
                    str(folder / dtype / "servo.o"), "-lm", "-o", str(folder / dtype / "angles")], check=True)
    told = subprocess.run([str(folder / dtype / "angles")], capture_output=True, text=True, check=True).stdout
    return [float(each) for each in told.split()]


@pytest.mark.long
@needs_compiler
@pytest.mark.parametrize("name", ["worn", *(pytest.param(name, marks=pytest.mark.slow) for name in WHOLE
                                            if name != "worn")])
def test_angles_are_those_of_doubles(name, tmp_path):
    for draw in (0, 1):
        floats, doubles = (angles(name, draw, tmp_path / str(draw), dtype) for dtype in ("float32", "float64"))
        assert len(floats) == len(doubles) == 400
        assert floats == pytest.approx(doubles, abs=1e-5, rel=0.0)
        assert max(doubles) - min(doubles) > 0.3


@needs_compiler
@pytest.mark.slow
def test_a_servo_on_a_bus_stays_within_counts(tmp_path):
    """A count more or less at one tick changes duties; the loop brings the shaft back."""
    for draw in range(3):
        floats, doubles = (np.array(angles("on a bus", draw, tmp_path / str(draw), dtype))
                           for dtype in ("float32", "float64"))
        assert np.sqrt(np.mean((floats - doubles)**2)) < COUNT
        assert np.max(np.abs(floats - doubles)) < 10.0 * COUNT


@pytest.mark.long
@needs_compiler
def test_times_keep_their_digits(tmp_path):
    """A long call is one of many: the servo has moved as in calls of 20 ms, ten minutes later too."""
    export.c(model_of("plain", 0), name="servo", dtype="float32").write(tmp_path)
    (tmp_path / "long.c").write_text(r"""
#include <stdio.h>
#include "servo.h"
int main(void) {
    servo_event rows[8];
    servo_events events = {rows, 8, 0};
    servo_state one, many;
    const float low = servo_command(&servo_table, 0.5f), high = servo_command(&servo_table, 1.5f);
    servo_init(&one, &servo_table, low, 0), servo_init(&many, &servo_table, low, 0);
    for (int k = 1; k <= 30000; k++)
        servo_advance(&many, &servo_table, 0.02 * k, low, 0.0f, NULL);
    servo_advance(&one, &servo_table, 600.0, low, 0.0f, NULL);
    servo_advance(&many, &servo_table, 600.03, high, 0.0f, NULL);
    servo_advance(&one, &servo_table, 600.03, high, 0.0f, &events);
    servo_signals now, then;
    servo_observe(&many, &servo_table, high, 0.0f, &now), servo_observe(&one, &servo_table, high, 0.0f, &then);
    printf("%.9g %.9g %.9g %.9g\n", (double)now.output_angle, (double)then.output_angle,
           servo_time(&one), (double)rows[0].time);
    return events.count == 0;
}
""")
    subprocess.run([COMPILER, "-O1", "-I", str(tmp_path), str(tmp_path / "long.c"), str(tmp_path / "servo.c"), "-lm",
                    "-o", str(tmp_path / "long")], check=True)
    done = subprocess.run([str(tmp_path / "long")], capture_output=True, text=True, check=True)
    now, then, time, event = map(float, done.stdout.split())
    assert then == pytest.approx(now, abs=2e-5)
    assert time == pytest.approx(600.03, abs=1e-6)
    assert 0.0 <= event <= 0.03


@pytest.mark.long
@needs_compiler
@pytest.mark.parametrize("period", [1e-3, 9e-4])  # a float that is longer, and one that is shorter
def test_ticks_stay_where_they_are(tmp_path, period):
    """Goals at ticks of a servo on a bus are heard by the same ticks as in doubles, half a minute later too.

    It goes to a failsafe angle some 0.4 s after each, between two ticks.
    """
    model = st.DigitalServo(model_of("on a bus", 0).servo.replace({
        "firmware.control_period": period, "firmware.signal_timeout": 0.4005, "firmware.signal_loss": "failsafe",
        "firmware.failsafe_angle": 0.5}))
    text = r"""
#include <math.h>
#include <stdio.h>
#include "servo.h"
int main(void) {
    servo_state servo;
    servo_signals now;
    double before = 0.0;
    servo_init(&servo, &servo_table, 0, 0);
    for (int k = 1; k <= 30000; k++) {
        const int turns = k / 777;
        const REAL goal = (REAL)0.2 * (REAL)(turns % 2);
        servo_advance(&servo, &servo_table, PERIOD * k, goal, 0, NULL);
        servo_observe(&servo, &servo_table, goal, 0, &now);
        if (fabs((double)now.goal_angle - before) > 0.1)
            printf("%d ", k);
        before = (double)now.goal_angle;
    }
#ifdef FLOATS
    fprintf(stderr, "%.9g", remainder(servo.begun / PERIOD, 1.0));
#endif
    return 0;
}
"""
    heard = {}
    for dtype, real in (("float32", "float"), ("float64", "double")):
        folder = tmp_path / dtype
        export.c(model, name="servo", dtype=dtype).write(folder)
        (folder / "ticks.c").write_text(text)
        subprocess.run([COMPILER, f"-DREAL={real}", f"-DPERIOD={period}", "-O1", *["-DFLOATS"] * (real == "float"),
                        "-I", str(folder), str(folder / "ticks.c"), str(folder / "servo.c"), "-lm",
                        "-o", str(folder / "ticks")], check=True)
        done = subprocess.run([str(folder / "ticks")], capture_output=True, text=True, check=True)
        heard[dtype] = done.stdout.split()
        if real == "float":
            assert abs(float(done.stderr)) < 1e-6  # of a tick
    assert len(heard["float64"]) > 70
    assert heard["float32"] == heard["float64"]


@pytest.mark.long
@needs_compiler
def test_what_is_no_number_changes_nothing(tmp_path):
    export.c(model_of("on a bus", 0), name="servo", dtype="float32").write(tmp_path)
    (tmp_path / "odd.c").write_text(r"""
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "servo.h"
int main(void) {
    servo_state servo, before;
    memset(&servo, 0, sizeof servo);
    const servo_servo *table = &servo_table;
    servo_init(&servo, table, 0.5f, 0), servo_advance(&servo, table, 0.1, 1.0f, 0.0f, NULL);
    memcpy(&before, &servo, sizeof servo);
    const int told[] = {servo_advance(&servo, table, (double)NAN, 1.0f, 0.0f, NULL),
        servo_advance(&servo, table, (double)INFINITY, 1.0f, 0.0f, NULL),
        servo_advance(&servo, table, 0.2, NAN, 0.0f, NULL), servo_advance(&servo, table, 0.2, 1e30f, 0.0f, NULL),
        servo_advance(&servo, table, 0.2, 1.0f, INFINITY, NULL), servo_advance(&servo, table, 0.05, 1.0f, 0.0f, NULL)};
    for (int k = 0; k < 6; k++)
        printf("%d ", told[k]);
    return memcmp(&before, &servo, sizeof servo) != 0;
}
""")
    subprocess.run([COMPILER, "-O1", "-I", str(tmp_path), str(tmp_path / "odd.c"), str(tmp_path / "servo.c"), "-lm",
                    "-o", str(tmp_path / "odd")], check=True)
    done = subprocess.run([str(tmp_path / "odd")], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["-1", "-1", "-2", "-2", "-1", "-3"]


@pytest.mark.parametrize(("model", "load", "more", "said"), [
    (st.PulseServo, None, {"dtype": "float16"}, "dtype: got 'float16'"),
    (st.DigitalServo, None, {"dtype": "float32"}, "a program that pulses tell its goals"),
    (st.PulseServo, st.loads.Flexible(inertia=1e-3, stiffness=5.0), {"dtype": "float32"}, "a spring between two"),
    (st.PulseServo, None, {"dtype": "float32", "parameters": True}, "with parameters"),
    (st.PulseServo, None, {"dtype": "float32", "accuracy": 1e-9}, "at least 1e-06 rad")])
def test_what_floats_are_not_for(model, load, more, said):
    made = model(st.load_servo("hitec-hs-755hb").replace(PROGRAM if model is st.DigitalServo else {}))
    with pytest.raises(InputError, match=said):
        export.c(made, load, **more)
