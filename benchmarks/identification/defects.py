"""Part 4: whether the verdict of a fit names what is wrong, for the defects of two independent benches.

Each defect on several random benches, from hardly to be seen to gross. The table says how often the verdict finds no
fault, and where it does, how often the true cause is the first that it names, among the first three, or not among them.
Registers for P are those of a bus servo, which another reference moves. A cause may be found in more than one way: lost
pulses and late stamps are both frames that came otherwise.

    python benchmarks/identification/defects.py home SEED [SERVO] [DEFECT ...]

fits a servo of the catalog (`tests/reference/rig_catalog.py`) by default arguments, once for each of 23 defects, and a
bus servo, and prints what is named first, the error in times of the noise and the seconds of CPU.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import rig_catalog
from reference.rig_defects import DEFECTS
from reference.rig_fits import OF_BUS, first_at_home, place, seen, seen_at_home

STRENGTHS = (0.2, 0.5, 0.8)


def main(*seeds: int, only: tuple[str, ...] = ()) -> None:
    chosen = range(seeds[0] if seeds else 4) if len(seeds) < 2 else seeds
    print(f"{len(chosen)} random benches, strengths {', '.join(f'{s:g}' for s in STRENGTHS)} of 1")
    rows = []
    for name in only or (*DEFECTS, *OF_BUS):
        every = [seen(name, strength, seed) for strength in STRENGTHS for seed in chosen]
        said = [one for one in every if not one.holds or place(name, one) == 0]
        places = [place(name, one) for one in said]
        first, three = sum(p == 0 for p in places), sum(p is not None and p < 3 for p in places)
        rows.append(f"  {name:18} {len(every):4d} {len(every) - len(said):9d} {first:7d} {three:9d} "
                    f"{len(said) - three:7d} {sum(one.seconds for one in every) / len(every):8.1f}")
        shown = next((one for one, p in zip(said, places, strict=True) if p == 0), said[0] if said else every[0])
        print(f"{name}: {shown.sentence}", flush=True)
        for line in (*(f"cause: {cause}" for cause in shown.causes[:3]), *shown.warnings[:2]):
            print(f"    {line}", flush=True)
    print(f"\n  {'defect':18} fits  no fault   first  of three   other  s of CPU")
    print("\n".join(rows), flush=True)


def home(seed: int, servo: str = "hitec-hs-755hb", *names: str) -> None:
    """Print the table of a servo of the catalog, fitted by default arguments."""
    right, spent, count = 0, 0.0, 0
    print(f"{servo}, seed {seed}\n  {'defect':28} {'first named':36} right  times noise  s of CPU", flush=True)
    for name in names or (*rig_catalog.DEFECTS, "wrong P register"):
        of_bus = name in OF_BUS
        one = seen(name, 0.5, seed) if of_bus else seen_at_home(servo, name, seed)
        good = place(name, one) == 0 if of_bus else first_at_home(name, one)
        named = one.causes[0] if one.causes else "-" if one.holds and not one.warnings else one.warnings[0] \
            if one.warnings else one.sentence
        right, spent, count = right + (good and name != "none"), spent + one.seconds, count + (name != "none")
        print(f"  {name:28} {named[:36]:36} {'yes' if good else 'NO':5} {one.ratio:11.1f} {one.seconds:9.1f}",
              flush=True)
    print(f"  first in {right} of {count}, {spent:.0f} s in all", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["home"]:
        home(int(sys.argv[2]), *sys.argv[3:])
    else:
        main(*(int(word) for word in sys.argv[1:] if word.isdecimal()),
             only=tuple(word for word in sys.argv[1:] if not word.isdecimal()))
