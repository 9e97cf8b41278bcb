"""Servos inside MuJoCo: how exact they are, what contacts cost, and what a joint costs beside `mj_step`.

`run.py` does all parts; `run.py accuracy`, `contact`, `speed`, `walker` or `gap` one of them.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


def main() -> None:
    try:
        import mujoco
    except ImportError:
        print("robots: left out, because MuJoCo is not installed")
        return
    import accuracy
    import contact
    import gap
    import speed
    import walker

    print(f"MuJoCo {mujoco.__version__}")
    parts = {"accuracy": (accuracy.hinge, accuracy.arm, accuracy.held), "contact": (contact.table,),
             "speed": (speed.table,), "walker": (walker.table,), "gap": (gap.table,)}
    for part in sys.argv[1:] or parts:
        if part not in parts:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(parts)}")
        for show in parts[part]:
            show()
        print(flush=True)


if __name__ == "__main__":
    main()
