"""Draw the picture of the guide's page on curves again: run this file."""

from pathlib import Path

import servotwin as st

if __name__ == "__main__":
    sheet = st.curves(st.PulseServo(st.load_servo("gobilda-2000-135")), voltage=[4.8, 6.0], bandwidth=False)
    st.plotting.save(st.plotting.speed_curves(sheet), Path(__file__).resolve().parents[1] / "images" / "curves.png",
                     overwrite=True)
