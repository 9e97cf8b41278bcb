"""Values in the names of files, and loads that one sidecar says of all of them."""

import json

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.logs import read_logs

ROWS = "".join(f"{2 * k},{min(max(k - 40, 0), 150)},{0.1 + 0.001 * k:.3f}\n" for k in range(300))
SAID = {"format": "servotwin-log-1", "columns": {
    "time": {"column": "1", "unit": "ms"}, "output_angle": {"column": "2", "unit": "deg"},
    "supply_current": {"column": "3", "unit": "A"}, "command_angle": {"column": "153deg@0s", "unit": "deg"}}}


def lifts(folder, files, names=("lift0.txt", "lift200.txt", "lift600.txt")):
    for name in names:
        (folder / name).write_text(ROWS)
    (folder / "logs.json").write_text(json.dumps({**SAID, "files": files}))


def test_a_weight_on_a_drum_comes_from_the_name(tmp_path):
    lifts(tmp_path, {"lift{mass}.txt": {"load": {"drum": {"mass": "{mass}g", "radius": 0.1, "inertia": 2e-4}},
                                        "conditions": {"weight": "with {mass} g", "grams": "{mass}"}}})
    logs = read_logs(tmp_path)
    assert [log.name for log in logs] == ["lift0", "lift200", "lift600"]
    for log, mass in zip(logs, (0.0, 0.2, 0.6), strict=True):
        assert log.load.torque == pytest.approx(mass * 9.80665 * 0.1)
        assert log.load.inertia == pytest.approx(mass * 0.01 + 2e-4)
        assert log.conditions == {"weight": f"with {1000 * mass:g} g", "grams": 1000 * mass}
        assert np.degrees(log.command[0]) == pytest.approx(153.0)
    assert read_logs(tmp_path / "lift200.txt")[0].load == logs[1].load


def test_an_arm_and_several_values(tmp_path):
    arm = {"mass": "{mass}g", "length": "{length}cm"}
    lifts(tmp_path, {"arm{mass}g_{length}cm_*.txt": {"load": {"pendulum": arm}}},
          ["arm100g_12.5cm_a.txt", "arm50g_8cm_b.txt"])
    first, second = read_logs(tmp_path)
    assert (first.load.pendulum.mass, first.load.pendulum.length) == pytest.approx((0.1, 0.125))
    assert (second.load.pendulum.mass, second.load.pendulum.length) == pytest.approx((0.05, 0.08))


@pytest.mark.parametrize(("files", "words"), [
    ({"lift{mass}.txt": {"load": {"drum": {"mass": "{weight}g", "radius": 0.1}}}}, ("'weight'", "mass")),
    ({"lift{mass}.txt": {"load": {"drum": {"mass": "{mass}furlong", "radius": 0.1}}}}, ("{mass}furlong",)),
    ({"lift{mass}.txt": {"load": {"drum": {"mass": "{mass}g"}}}}, ("also radius",)),
    ({"lift{mass}.txt": {"load": {"drum": {"mass": "{mass}g", "radius": -1.0}}}}, ("radius", "0 or more")),
    ({"lift{m}{m}.txt": {"motion": "x"}}, ("{m}", "once")),
])
def test_what_is_wrong_is_said_in_one_line(tmp_path, files, words):
    lifts(tmp_path, files)
    with pytest.raises(InputError) as caught:
        read_logs(tmp_path / "lift200.txt")
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert "logs.json" in str(caught.value) or "once" in str(caught.value)


def test_commands_about_an_end_of_the_travel_are_centred_before_a_fit():
    from servotwin.identification.fitting.suspicions.followed import centred
    from servotwin.logs import Log

    time = 0.02 * np.arange(300)
    command = np.radians(np.where(time % 2.0 < 1.0, 40.0, 150.0))
    model = st.BoundedServo(st.load_servo("towerpro-mg996r"))
    for sign, zero in ((1.0, 0.0), (-1.0, np.pi)):
        log = Log(name="a", time=time, command=command, command_kind="angle",
                  measured={"output_angle": sign * command + zero})
        found = centred([log], model)
        np.testing.assert_allclose(found.logs[0].command, command - np.pi / 2.0)
        np.testing.assert_allclose(found.logs[0].measured["output_angle"], command - np.pi / 2.0, atol=1e-9)
        assert ("counts against" in found.sentences[0]) == (sign < 0.0)
        assert centred(found.logs, model).sentences == ()
    log = Log(name="a", time=time, command=2.0 * command, command_kind="angle", measured={"output_angle": command})
    with pytest.raises(InputError, match=r"row 51 \(1 s\), command: got '300 deg'.*-75 to 75 deg, the travel of tower"):
        centred([log], model)
