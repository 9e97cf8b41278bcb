"""The reference's random cases, told to the package."""

import numpy as np

import servotwin as st


def servo_of(case):
    return st.servo_from_values("random", case.servo)


def load_of(spec):
    make = {"inertia": lambda v: st.loads.Inertia(v["inertia"]),
            "viscous": lambda v: st.loads.Viscous(v["viscous_friction"]),
            "constant": lambda v: st.loads.Constant(v["torque"]),
            "coulomb": lambda v: st.loads.Coulomb(v["torque"]),
            "pendulum": lambda v: st.loads.Pendulum(**v),
            "spring": lambda v: st.loads.Spring(**v),
            "recorded": lambda v: st.loads.Recorded(**v)}
    load = st.loads.Load()
    for kind, values in spec.items():
        load = load + make[kind](values)
    return load


def command_of(spec):
    words = {key: value for key, value in spec.items() if key != "kind"}
    kind = spec["kind"]
    if kind == "ramp":
        return st.signals.ramp(words["before"], words["after"], at=words["at"], over=words["duration"], unit="V")
    if kind == "chirp":
        words["end_frequency"] = words.pop("stop_frequency")
        return st.signals.chirp(**words)
    if kind == "prbs":
        bits = np.asarray(words["bits"])
        return st.signals.samples(np.arange(bits.size) * words["interval"],
                                  np.where(bits == 1, words["high"], words["low"]), unit="V")
    if kind == "samples":
        return st.signals.samples(words["time"], words["value"], unit="V", hold=words["hold"])
    return getattr(st.signals, kind)(**words)
