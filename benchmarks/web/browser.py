"""The page in a browser without a GPU: bytes of a first visit, time until it is usable, slider to trace, frames drawn.

The peer of the frames is the same browser on an empty page; the others stand beside their bars.
"""

import math
import shutil
import statistics
import sys
from typing import Any

from talk import server

BYTES, USABLE, LATENCY = 300e3, 1.0, 0.1  # bars: bytes, s, s
VISITS, MOVES, SECONDS = 5, 30, 5.0
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
             "--disable-component-update", "--disable-sync"]
WATCH = """
window.usable = 0;
const watching = setInterval(() => {
  if (!(document.body && document.body.classList.contains("ready") && window.bench && window.bench.header)) return;
  window.usable = performance.now();
  clearInterval(watching);
}, 1);
window.frames_drawn = 0;
let latest = -1;
const ask = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (act) => ask((now) => {
  if (now !== latest) { latest = now; window.frames_drawn += 1; }
  act(now);
});
"""
EMPTY = """(seconds) => new Promise((done) => {
  let [count, start] = [0, performance.now()];
  const next = (now) => {
    count += 1;
    if (now - start < 1000 * seconds) requestAnimationFrame(next); else done(count / seconds);
  };
  requestAnimationFrame(next);
})"""
TO_TRACE = """() => new Promise((done) => {
  const slide = document.querySelector(".command input[type=range]");
  slide.addEventListener("input", (event) => {
    const wanted = Number(slide.closest(".slider").querySelector("input[type=number]").value);
    const seen = () => {
      if (Math.abs(1e6 * bench.history[0].latest("pulse_width") - wanted) > 0.01) return;
      bench.removeEventListener("push", seen);
      requestAnimationFrame(() => done(performance.now() - event.timeStamp));  // after the traces of this push
    };
    bench.addEventListener("push", seen);
  }, { once: true });
  window.armed = true;
  setTimeout(() => done(NaN), 5000);
})"""


def visits(browser: Any, address: str) -> tuple[float, list[float]]:
    """Return the bytes of a first visit, and when the page was usable in several [s]."""
    size, usable = 0.0, []
    for _ in range(VISITS):
        context = browser.new_context(bypass_csp=True)
        page = context.new_page()
        loaded: list[Any] = []
        page.on("response", lambda one, loaded=loaded: loaded.append(one))
        page.add_init_script(WATCH)
        page.goto(address)
        page.wait_for_function("window.usable > 0")
        page.wait_for_timeout(500)
        size = sum(len(one.body()) for one in loaded)
        usable.append(1e-3 * page.evaluate("window.usable"))
        context.close()
    return size, usable


def slider_to_trace(page: Any) -> list[float]:
    """Return how long it took from the event of a key to the frame with the new command, each time [s]."""
    slide, found = page.get_by_label("pulse, slider"), []
    slide.focus()
    for k in range(MOVES):
        page.evaluate("() => { window.armed = false; }")
        page.evaluate(f"() => {{ window.lasted = ({TO_TRACE})(); return 0; }}")
        page.wait_for_function("window.armed")
        page.wait_for_timeout(50 + 7 * k % 40)  # at any place within a frame of the transmitter
        slide.press("ArrowRight" if k % 2 == 0 else "ArrowLeft")
        found.append(1e-3 * page.evaluate("window.lasted"))
    lost = sum(map(math.isnan, found))
    if lost:
        print(f"  {lost} of {MOVES} moves did not show within 5 s")
    return [one for one in found if not math.isnan(one)]


def drawn(page: Any) -> float:
    """Return in how many frames a second something was drawn."""
    page.wait_for_timeout(1000)
    before = page.evaluate("[performance.now(), window.frames_drawn]")
    page.wait_for_timeout(1000 * SECONDS)
    after = page.evaluate("[performance.now(), window.frames_drawn]")
    return float((after[1] - before[1]) / (1e-3 * (after[0] - before[0])))


def main() -> None:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("browser: playwright is not installed")
        return
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        print("browser: no Chromium on this computer")
        return
    with server() as (links, _), sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        print(f"Chromium {browser.version}, headless, without a GPU\n  {'':36} {'is':>10} {'bar':>10} {'ratio':>6}")
        size, usable = visits(browser, links["page"])
        _row("bytes of a first visit", size / 1e3, BYTES / 1e3, "kB")
        _row("usable after (median)", 1e3 * statistics.median(usable), 1e3 * USABLE, "ms")
        page = browser.new_page(viewport={"width": 1280, "height": 900}, bypass_csp=True)
        empty = page.evaluate(EMPTY, SECONDS)
        page.add_init_script(WATCH)
        page.goto(links["page"])
        page.wait_for_function("window.usable > 0 && bench.time > 1")
        lasted = slider_to_trace(page)
        _row("slider to trace (median)", 1e3 * statistics.median(lasted), 1e3 * LATENCY, "ms")
        _row("slider to trace (nine of ten)", 1e3 * statistics.quantiles(lasted, n=10)[-1], 1e3 * LATENCY, "ms")
        for name, command in (("at rest", None), ("moving", "{shape: 'sine', unit: 'us', mean: 1500, amplitude: 200, "
                                                  "frequency: 0.5}")):
            if command is not None:
                page.evaluate(f"bench.do('command', {command})")
            print(f"  {f'frames drawn a second, {name}':36} {drawn(page):10.1f}   (an empty page: {empty:.1f})",
                  flush=True)
        behind = page.evaluate("bench.header.behind")
        print(f"  pace of the bench: {page.evaluate('bench.header.pace'):.3f}{', behind' if behind else ''}")
        browser.close()


def _row(name: str, value: float, bar: float, unit: str) -> None:
    print(f"  {name:36} {value:7.0f} {unit:2} {bar:7.0f} {unit:2} {value / bar:6.2f}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
