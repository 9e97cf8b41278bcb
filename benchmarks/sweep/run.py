"""A sweep of 100 000 pulse servos for 2 s: wall time, and its ratio to the bare `simulate_many`.

Both take the same drawn parameters. The bare call keeps nothing but the last angle; the second one keeps the samples
that the metrics are made of, chunk by chunk, and makes nothing of them.
"""

import time

import servotwin as st

LANES, DURATION, AT = 100_000, 2.0, 0.1
VARY = {"motor.torque_constant": "normal:3%", "motor.armature_resistance": "normal:5%",
        "electronics.deadband": "uniform:4us..8us", "electronics.stretcher_gain": "uniform:10%",
        "load.inertia": "uniform:0..1e-3", "load.torque": "uniform:0..0.1"}
SIGNALS = ("output_angle", "output_speed", "command_angle", "armature_current")
PIECE = 4096


def timed(run) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def main() -> None:
    model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    command = st.signals.step(0.0, 60.0, at=AT, unit="deg")
    cold = timed(lambda: st.sweep(model, command, duration=DURATION, lanes=100, vary=VARY))
    studies = []
    whole = min(timed(lambda: studies.append(st.sweep(model, command, duration=DURATION, lanes=LANES, vary=VARY)))
                for _ in range(3))
    columns = dict(studies[-1].plan.columns)
    bare = min(timed(lambda: st.simulate_many(model, command, duration=DURATION, parameters=columns,
                                              output_times=[DURATION])) for _ in range(3))
    times = studies[-1].plan.job.times

    def sampled() -> None:
        for k in range(0, LANES, PIECE):
            piece = {name: column[k:k + PIECE] for name, column in columns.items()}
            st.simulate_many(model, command, duration=DURATION, parameters=piece, output_times=times,
                             outputs=SIGNALS)

    samples = timed(sampled)
    print(f"sweep of {LANES} PulseServo for {DURATION:g} s, {len(VARY)} parameters, {len(times)} samples a lane")
    print(f"  first call of the process, 100 lanes     {cold:7.2f} s")
    print(f"  whole sweep, six metrics and the tornado {whole:7.2f} s  {LANES * DURATION / whole:9.3g} servo-s/s")
    for words, took in (("the last angle alone", bare), ("samples of its signals", samples)):
        print(f"  simulate_many, {words:25} {took:7.2f} s  sweep takes {whole / took:.1f} times as long")


if __name__ == "__main__":
    main()
