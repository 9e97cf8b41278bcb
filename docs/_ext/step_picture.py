"""Draw the picture of README and front page again: run this file."""

from pathlib import Path

import servotwin as st

PICTURE = Path(__file__).resolve().parents[1] / "images" / "step.png"


def main():
    command = st.signals.step(0.0, 180.0, at=0.1, unit="deg")
    result = st.simulate(st.PulseServo(st.load_servo("hitec-hs-755hb")), command, duration=1.2)
    figure = st.plotting.time_response(result, ["output_angle", "armature_voltage", "armature_current"])
    st.plotting.save(figure, PICTURE, overwrite=True)


if __name__ == "__main__":
    main()
