"""The page as one file in a browser: sizes, time until it draws, slider to trace, a second of six servos.

Its peer until it draws is an empty page of the same size; times of our own script are those of Chromium's main thread.
"""

import shutil
import statistics
import tempfile
from pathlib import Path
from typing import Any

from browser import ARGUMENTS, TO_TRACE, WATCH

from servotwin.web.alone.page import page as one_file
from servotwin.web.alone.page import sizes
from servotwin.web.server.serve import first_scene

BYTES, SCRIPT, SECOND, VISITS, MOVES = 450e3, 0.025, 0.5, 5, 20
SIX = {
    "six pulse servos on one supply": ("hitec-hs-755hb", "PulseServo", 6, "[supply]\nopen_circuit_voltage = 6.0\n"
                                       "internal_resistance = 0.3\n", "us", 1300.0, 1700.0, 1),
    "six STS3215": ("feetech-sts3215-12v", "DigitalServo", 6, "", "deg", -40.0, 40.0, 1),
    "one STS3215, processor 4 times slower": ("feetech-sts3215-12v", "DigitalServo", 1, "", "deg", -40.0, 40.0, 4)}
SECONDS = """async (text) => {
  const names = ["kernel", "live", "scene"];
  const [{ Kernel }, { Live }, { read }] = await Promise.all(names.map((one) => import(`bench/${one}.js`)));
  const { world, module } = globalThis.servotwin;
  const live = new Live(new Kernel(module, world.layout), world, { ...read(world, text), end: 0 });
  const ends = live.servos.map(() => [Infinity, -Infinity]);
  const run = (until) => {
    while (!live.going.reached(until)) {
      live.advance(Math.min(until, live.time + 1 / 60), 180).parts.forEach(({ columns, points }, k) => {
        const at = columns.indexOf("output_angle");
        for (let n = at; n < points.length; n += columns.length) {
          ends[k] = [Math.min(ends[k][0], points[n]), Math.max(ends[k][1], points[n])];
        }
      });
    }
  };
  run(1);
  const begun = performance.now();
  run(3);
  return [(performance.now() - begun) / 2000, Math.min(...ends.map(([low, high]) => (high - low) * 180 / Math.PI))];
}"""


def scene(name: str, model: str, count: int, more: str, unit: str, low: float, high: float) -> str:
    """Return a bench whose servos go to and fro."""
    command = f'{{shape = "step", unit = "{unit}", low = {low}, high = {high}, period = 0.8}}'
    servos = f'[[servo]]\nid = "{name}"\nmodel = "{model}"\n' * count
    return f'format = 1\nactions = [[0.0, "command", {command}]]\n{servos}[load]\ninertia = 2e-4\n{more}'


def script_time(session: Any) -> float:
    """Return how long the main thread has run scripts [s]."""
    return float(next(one["value"] for one in session.send("Performance.getMetrics")["metrics"]
                      if one["name"] == "ScriptDuration"))


def busy(session: Any) -> float:
    """Return how long the main thread has been busy [s]."""
    return float(next(one["value"] for one in session.send("Performance.getMetrics")["metrics"]
                      if one["name"] == "TaskDuration"))


def first_trace(browser: Any, address: str, ready: str) -> tuple[float, float]:
    """Return when a page is ready, and how busy its thread was by then, median of some visits [s]."""
    found = []
    for _ in range(VISITS):
        context = browser.new_context(bypass_csp=True)
        page = context.new_page()
        session = context.new_cdp_session(page)
        session.send("Performance.enable")
        page.add_init_script(WATCH)
        page.goto(address)
        page.wait_for_function(ready)
        found.append((1e-3 * page.evaluate("window.usable || performance.now()"), busy(session)))
        context.close()
    return tuple(statistics.median(column) for column in zip(*found, strict=True))  # type: ignore[return-value]


def main() -> None:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("alone: playwright is not installed")
        return
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        print("alone: no Chromium on this computer")
        return
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        text = one_file(first_scene())
        path, empty = Path(folder) / "bench.html", Path(folder) / "empty.html"
        path.write_text(text, encoding="utf-8")
        empty.write_text(f"<!doctype html><title>empty</title><script type=text/plain>{'x' * len(text)}</script>")
        browser = play.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        print(f"the page as one file, Chromium {browser.version}, headless, without a GPU")
        print("  bytes: " + ", ".join(f"{name} {size}" for name, size in sizes(text).items()) + f" (bar {BYTES:.0f})")
        bare, bare_busy = first_trace(browser, empty.as_uri(), "document.readyState === 'complete'")
        own, own_busy = first_trace(browser, path.as_uri(), "window.usable > 0")
        print(f"  first trace after {1e3 * own:.0f} ms, busy {1e3 * own_busy:.0f} ms; an empty page of the same size "
              f"{1e3 * bare:.0f} ms, busy {1e3 * bare_busy:.0f} ms (bar: busy {1e3 * (1.5 * bare_busy + 0.5):.0f} ms)")
        page = browser.new_page(viewport={"width": 1280, "height": 900}, bypass_csp=True)
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        page.add_init_script(WATCH)
        page.goto(path.as_uri())
        page.wait_for_function("window.usable > 0 && bench.time > 1")
        lasted, script = moved(page, session)
        print(f"  slider to trace {1e3 * lasted:.0f} ms (median), of these {1e3 * script:.1f} ms of script "
              f"(bar {1e3 * SCRIPT:.0f} ms)")
        page.evaluate("bench.ask({run: false})")
        for name, (*servo, slower) in SIX.items():
            session.send("Emulation.setCPUThrottlingRate", {"rate": slower})
            lasted, swing = page.evaluate(SECONDS, scene(*servo))
            print(f"  {name}: {lasted:.3f} s for a second, in which each moves by {swing:.0f} degrees "
                  f"(bar {1.0 if slower > 1 else SECOND})")
            session.send("Emulation.setCPUThrottlingRate", {"rate": 1})
        browser.close()


def moved(page: Any, session: Any) -> tuple[float, float]:
    """Return how long it takes from a key at the slider to the trace, and how long scripts run meanwhile [s]."""
    slide, found = page.get_by_label("pulse, slider"), []
    slide.focus()
    for k in range(MOVES):
        page.evaluate("() => { window.armed = false; }")
        page.evaluate(f"() => {{ window.lasted = ({TO_TRACE})(); return 0; }}")
        page.wait_for_function("window.armed")
        page.wait_for_timeout(50 + 7 * k % 40)
        before = script_time(session)
        slide.press("ArrowRight" if k % 2 == 0 else "ArrowLeft")
        lasted = 1e-3 * page.evaluate("window.lasted")
        found.append((lasted, script_time(session) - before))
    return tuple(statistics.median(column) for column in zip(*found, strict=True))  # type: ignore[return-value]


if __name__ == "__main__":
    main()
