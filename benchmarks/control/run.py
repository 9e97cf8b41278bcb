"""Each controller beside plain commands on the case that it is for: errors, factor, and how long a loop takes."""

import time

from cases import Case, cases

TITLE = "| controller | servo | its case | without [deg] | with it [deg] | factor |\n|---|---|---|---|---|---|"


def row(case: Case) -> str:
    """Return a row of the table."""
    without, with_it = case.errors()
    against = "" if case.against == "plain commands" else f" (beside {case.against})"
    return (f"| `{case.controller}` | {case.servo} | {case.task}{against} | {without:.2f} | {with_it:.2f} "
            f"| {without / with_it:.1f} |")


def main() -> None:
    print(f"rms error, of the ringing for InputShaper:\n\n{TITLE}")
    for case in cases():
        print(row(case), flush=True)
    print("\nseconds of computing for a second of the loop:")
    for case in cases():
        start = time.perf_counter()
        run = case.with_it()
        lasted = time.perf_counter() - start
        print(f"{case.controller:22} {case.servo:18} {lasted / run.true_time[-1]:6.2f}", flush=True)


if __name__ == "__main__":
    main()
