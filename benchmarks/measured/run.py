"""Fits to measured servos: errors on runs that were not fitted, beside simpler models, and what each physics earns.

Needs the measurements, which are not part of the repository: give their folder, or have it at ../shared/data.
    python benchmarks/measured/run.py [--data FOLDER] [miuzei] [bam] [xl330] [maccepa] [feetech]
                                        [ladder [RUNS [SECONDS]]]
The ladder of friction laws takes far longer than the others, and only runs where it is named.
"""

import sys
from pathlib import Path

import bam
import feetech
import ladder
import maccepa
import miuzei
import xl330

USUAL = {"miuzei": miuzei.main, "bam": bam.main, "xl330": xl330.main, "maccepa": maccepa.main,
         "feetech": feetech.main}
DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def main(arguments: list[str]) -> None:
    folder = DATA
    if "--data" in arguments:
        place = arguments.index("--data")
        folder = Path(arguments[place + 1])
        arguments = arguments[:place] + arguments[place + 2:]
    if not folder.is_dir():
        print(f"measured servos: left out, because there is no {folder}")
        return
    words = list(arguments or USUAL)
    while words:
        name = words.pop(0)
        if name == "ladder":
            ladder.main(folder, *numbers(words))
        elif name in USUAL:
            USUAL[name](folder)
        else:
            sys.exit(f"run.py: {name!r} is not one of {', '.join(USUAL)}, ladder [RUNS [SECONDS]]")


def numbers(words: list[str]) -> list[int]:
    """Take the whole numbers that words begin with out of them."""
    found = []
    while words and words[0].isdecimal():
        found.append(int(words.pop(0)))
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
