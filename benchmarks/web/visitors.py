"""What visitors cost the server: one at rest and moving, eight at once, other scenes, and forty who watch.

The peer is the bare engine: `Simulator.advance` of the same servos under the same command for the same bench time, with
nothing shown. Its time is that of a second of the bench, as the server's share of a core is.
"""

import asyncio
import time
from typing import Any
from urllib.parse import urlsplit

from talk import Client, come, server, watched

import servotwin as st
from servotwin.web.live import read_scene
from servotwin.web.live.actions import checked_command, command_signal
from servotwin.web.live.live_bench import load_of
from servotwin.web.server.serve import first_scene

SECONDS = 10.0
BAR = 0.10  # of a core for one visitor
TOLD = {
    "at rest": {"shape": "hold", "unit": "deg", "value": 90.0},
    "sine of 0.5 Hz": {"shape": "sine", "unit": "deg", "mean": 90.0, "amplitude": 30.0, "frequency": 0.5},
    "a step each second": {"shape": "step", "unit": "deg", "low": 70.0, "high": 110.0, "period": 2.0}}
SWAY = {"shape": "sine", "unit": "deg", "mean": 0.0, "amplitude": 30.0, "frequency": 0.5}
"""For servos whose middle is 0."""
ANALOG, DIGITAL, BUS = "hitec-hs-755hb", "towerpro-mg996r", "feetech-sts3215-12v"
ARM = "\n[load]\nmass = 0.05\narm = 0.1\n"
SCENES = {
    "PulseServo": (f'[[servo]]\nid = "{ANALOG}"\nmodel = "PulseServo"\n', TOLD["sine of 0.5 Hz"]),
    "PulseServo, pendulum": (f'[[servo]]\nid = "{ANALOG}"\nmodel = "PulseServo"\n{ARM}', TOLD["sine of 0.5 Hz"]),
    "PulseServoInductive": (f'[[servo]]\nid = "{ANALOG}"\nmodel = "PulseServoInductive"\n', TOLD["sine of 0.5 Hz"]),
    "DigitalServo": (f'[[servo]]\nid = "{DIGITAL}"\n', SWAY), "STS3215": (f'[[servo]]\nid = "{BUS}"\n', SWAY),
    "STS3215, pendulum": (f'[[servo]]\nid = "{BUS}"\n{ARM}', SWAY),
    "six PulseServo": (f'[[servo]]\nid = "{ANALOG}"\nmodel = "PulseServo"\n' * 6, TOLD["sine of 0.5 Hz"])}
HEAD = (f"  {'':24} {'share of a core':>16} {'bare engine':>12} {'ratio':>6} {'pace':>6} {'pushes':>7} "
        f"{'bytes':>6}  behind")


def bare(text: str, command: dict[str, Any], seconds: float = 5.0) -> float:
    """Return what a second of the bench costs the engine alone [s]."""
    scene, spent = read_scene(text), 0.0
    for servo in scene.servos:
        sim, told = st.Simulator(servo.built(), load_of(scene)), command_signal(checked_command(command), 0.0)
        state = sim.initial(told)
        start = time.process_time()
        sim.advance(state, seconds, told)
        spent += time.process_time() - start
    return spent / seconds


def row(name: str, seen: dict[str, float], engine: float) -> str:
    return (f"  {name:24} {100.0 * seen['share']:14.1f} % {100.0 * engine:10.2f} % {seen['share'] / engine:6.1f} "
            f"{seen['pace']:6.3f} {seen['rate']:5.1f}/s {seen['bytes']:6.0f} {seen['behind']:7.0f}")


async def _begin(links: dict[str, Any], count: int, command: dict[str, Any], scene: str | None = None) -> list[Client]:
    clients = [await come(links["page"]) for _ in range(count)]
    for one in clients:
        if scene is not None:
            await one.say(scene=scene)
        await one.say(do="command", value=command)
    return clients


async def _cost(links: dict[str, Any], pid: int, count: int, command: dict[str, Any], scene: str | None = None,
                ) -> dict[str, float]:
    clients = await _begin(links, count, command, scene)
    found = await watched(clients, pid, SECONDS)
    for one in clients:
        await one.leave()
    await asyncio.sleep(0.3)
    return found


def one() -> None:
    text = first_scene().text()
    with server() as (links, pid):
        print(f"one visitor, pulse and bounded side by side; bar: {100.0 * BAR:.0f} % of a core\n{HEAD}")
        for name, command in TOLD.items():
            print(row(name, asyncio.run(_cost(links, pid, 1, command)), bare(text, command)), flush=True)


def eight() -> None:
    text = first_scene().text()
    with server() as (links, pid):
        print(f"eight visitors of the same scene; bar: a pace of 1\n{HEAD}")
        for name, command in TOLD.items():
            print(row(name, asyncio.run(_cost(links, pid, 8, command)), 8.0 * bare(text, command)), flush=True)


def scenes() -> None:
    with server() as (links, pid):
        print(f"other scenes, a sine of 0.5 Hz and ±30°\n{HEAD}")
        for name, (body, command) in SCENES.items():
            text = f"format = 1\n{body}"
            print(row(name, asyncio.run(_cost(links, pid, 1, command, text)), bare(text, command)), flush=True)


def watchers() -> None:
    async def measured(links: dict[str, Any], pid: int, count: int) -> dict[str, float]:
        port = urlsplit(links["page"]).port
        address, teaches = f"http://127.0.0.1:{port}/", urlsplit(links["teacher"]).query
        teacher = await come(address, f"?{teaches}")
        await teacher.say(do="command", value=TOLD["sine of 0.5 Hz"])
        clients = [teacher, *[await come(address, f"?code={links['code']}") for _ in range(count)]]
        found = await watched(clients, pid, SECONDS)
        for one in clients:
            await one.leave()
        return found

    text, command = first_scene().text(), TOLD["sine of 0.5 Hz"]
    print(f"a class: one bench, and so many who watch\n{HEAD}")
    for count in (0, 10, 40):
        with server("--host", "0.0.0.0", "--class") as (links, pid):
            print(row(f"{count} watchers", asyncio.run(measured(links, pid, count)), bare(text, command)), flush=True)
