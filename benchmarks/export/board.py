"""Exported servos on a Cortex-M4, emulated: flash, RAM, and the instructions of a call.

`board.py` prints, for servos of several kinds, in doubles and in floats, what the code of one takes of flash (with
the routines for doubles, for which this processor has no instructions), its state, the deepest stack, and the
instructions of a call that goes on by 1 ms and by a frame of 20 ms, on average and at most, and of one that looks at
all signals. QEMU counts instructions; a Cortex-M4 takes 1 to 1.5 cycles for one (assumed; Arm gives no number for
programs). Beside them stands what the same servo takes of an ATmega328P's 32 KiB, where doubles have 32 bits too
(avr-gcc 5): too much, always.
"""

import re
import shutil
import subprocess
import tempfile
from itertools import product
from pathlib import Path

from run import BUS, HEAT, HIGH, LOW, SERVO

import servotwin as st

HERE = Path(__file__).parent
START = HERE.parents[1] / "tests" / "export" / "harness"
BOARD = ("arm-none-eabi-gcc", "--specs=rdimon.specs", "--specs=nano.specs", "-nostartfiles", "-mcpu=cortex-m4",
         "-mthumb", "-std=gnu99", "-Os", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections",
         "-T", str(START / "cortex_m4.ld"), str(START / "cortex_m4.c"), str(HERE / "board.c"))
EMULATED = ("qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=0", "-nographic", "-monitor", "none", "-serial",
            "none", "-semihosting-config", "enable=on,target=native", "-kernel")
REALS = {"float64": ("-DREAL=double",), "float32": ("-DREAL=float", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")}
PER_COUNT = 40  # instructions: of 1 ns each, where the board's counter has 25 MHz
FRAME, STEP = 0.02, 1e-3  # s
SERVOS = {
    "bounded": (st.BoundedServo, SERVO, {}), "averaged": (st.AveragedServo, SERVO, {}),
    "pulses": (st.PulseServo, SERVO, {}),
    "play": (st.PulseServo, SERVO, {"gear.backlash": 0.02, "gear.output_inertia": 1e-4}),
    "heat": (st.PulseServo, SERVO, HEAT), "on a bus": (st.DigitalServo, BUS, {})}


def built(folder: Path, *words: str) -> dict[str, int]:
    """Make the program; return what its parts take [bytes]."""
    sources = [] if "-DNOTHING" in words else [str(folder / "servo.c"), "-I", str(folder)]
    subprocess.run([*BOARD, *words, *sources, "-lm", "-o", str(folder / "board.elf")], check=True)
    said = subprocess.run(["arm-none-eabi-size", str(folder / "board.elf")], capture_output=True, text=True, check=True)
    text, data, bss = map(int, said.stdout.splitlines()[1].split()[:3])
    return {"flash": text + data, "RAM": data + bss}


def told(folder: Path) -> list[int]:
    """Run the program; return counts of all calls, of the longest one and of all looks, and bytes of stack."""
    done = subprocess.run([*EMULATED, str(folder / "board.elf")], capture_output=True, text=True, check=True)
    return [int(each) for each in done.stdout.split()]


def of_avr(folder: Path) -> str:
    """Return what the code takes on an ATmega328P with floats of 32 bits, the checks of sizes left out."""
    if shutil.which("avr-gcc") is None:
        return "no avr-gcc"
    text = (folder / "servo.c").read_text(encoding="utf-8")
    (folder / "avr.c").write_text(re.sub(r"^CHECKED_SIZE.*", "", text, flags=re.MULTILINE), encoding="utf-8")
    subprocess.run(["avr-gcc", "-std=c99", "-Os", "-w", "-mmcu=atmega328p", "-I", str(folder), "-c", "-o",
                    str(folder / "avr.o"), str(folder / "avr.c")], check=True)
    said = subprocess.run(["avr-size", str(folder / "avr.o")], capture_output=True, text=True, check=True)
    return f"{int(said.stdout.splitlines()[1].split()[0]) / 1024:.0f} KiB"


def main() -> None:
    calls = int(re.search(r"CALLS = (\d+)", (HERE / "board.c").read_text(encoding="utf-8"))[1])
    print(f"{'servo':10}{'numbers':>9}{'flash':>10}{'state':>7}{'stack':>7}   {'1 ms, most':>20}   {'20 ms, most':>20}"
          f"{'look':>8}{'AVR':>10}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        without = built(folder, "-DNOTHING")
        for (kind, (model, servo, changes)), (dtype, words) in product(SERVOS.items(), REALS.items()):
            made = st.export.c(model(st.load_servo(servo).replace(changes)), name="servo", dtype=dtype)
            made.write(folder, overwrite=True)
            counts = {}
            for step in (STEP, FRAME):
                sizes = built(folder, *words, f"-DSTEP={step}", f"-DLOW={LOW}", f"-DHIGH={HIGH}")
                counts[step] = told(folder)
            long = [f"{PER_COUNT * counts[step][0] / calls:,.0f}, {PER_COUNT * counts[step][1]:,}" for step in counts]
            print(f"{kind:10}{dtype:>9}{(sizes['flash'] - without['flash']) / 1024:6.1f} KiB"
                  f"{sizes['RAM'] - without['RAM']:7}{max(each[3] for each in counts.values()):7}"
                  f"   {long[0]:>20}   {long[1]:>20}{PER_COUNT * counts[STEP][2] / calls:8,.0f}{of_avr(folder):>10}")


if __name__ == "__main__":
    main()
