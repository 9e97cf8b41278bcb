"""Some short logs of a servo that is known, as files."""

import numpy as np

import servotwin as st
from servotwin.identification import Log, write_log

SERVO = "hitec-hs-755hb"
INERTIA, COULOMB = 6.0e-8, 0.26341  # of the motor [kg m²]; at the output, that of the catalog servo [N m]
OUTPUT_INERTIA = INERTIA * 280.0**2
NOISE = 1e-3  # rad


def made_logs(count=4):
    """Return logs of a bounded servo with another rotor than that of the catalog."""
    servo = st.load_servo(SERVO).replace({"motor.rotor_inertia": INERTIA})
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 0.7, 0.02)
    logs = []
    for k, target in enumerate((60.0, 30.0, 80.0, 20.0)[:count]):
        command = np.radians(np.where(time < 0.1, 0.0, target))
        motion = "step"
        if k == 1:
            command, motion = np.radians(np.select([time < 0.1, time < 0.3], [0.0, 40.0], 10.0)), "stairs"
        run = st.simulate(st.BoundedServo(servo), st.signals.samples(time, command, unit="rad"),
                          duration=float(time[-1]), output_times=time)
        logs.append(Log(name=f"{motion}-{k}", time=time, command=command, command_kind="angle", motion=motion,
                        measured={"output_angle": run["output_angle"] + rng.normal(0.0, NOISE, len(time))}))
    return logs


def write_logs(folder, count=4):
    """Write them as CSV files with sidecars."""
    folder.mkdir()
    for log in made_logs(count):
        write_log(log, folder / f"{log.name}.csv")
    return folder
