"""Draw the pictures of the bench in the browser again, that of the README among them: run this file where Chromium is.

Each picture is the page itself, served by `servotwin web` and looked at by Chromium without a window.
"""

import contextlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

IMAGES = Path(__file__).resolve().parents[1] / "images"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
             "--disable-component-update", "--disable-sync"]
LARGEST = 300_000  # bytes of a picture
COLOURS = 160  # of a picture: the page has few

STEPS = """
format = 1
actions = [[0.0, "command", {shape = "hold", value = 60.0, unit = "deg"}],
           [0.3, "command", {shape = "step", low = 60.0, high = 130.0, period = 2.0, unit = "deg"}]]
servo = [{id = "hitec-hs-755hb", model = "PulseServo"}, {id = "hitec-hs-755hb", model = "BoundedServo"}]
load = {inertia = 3e-4, torque = 0.15}
view = {"traces.window" = 2.0, "traces.shown" = "Angle Speed", "scope.base" = 5e-3, "command.unit" = "deg"}
"""
FIRST = """
format = 1
actions = [[0.0, "command", {shape = "hold", value = 60.0, unit = "deg"}],
           [0.4, "command", {shape = "sine", mean = 90.0, amplitude = 40.0, frequency = 0.8, unit = "deg"}]]
servo = [{id = "hitec-hs-755hb", model = "PulseServo"}]
load = {inertia = 1e-4, mass = 0.1, arm = 0.05, hanging_angle = -1.5707963}
view = {"traces.window" = 2.0, "command.unit" = "deg"}
"""
PICTURES = {  # name: bench, at which time it is looked at [s], what is asked of the browser, how much of the page
    "web_bench": (STEPS, 3.56, {"viewport": {"width": 1280, "height": 1012}}, None),
    "web_dark": (STEPS, 3.56, {"viewport": {"width": 1280, "height": 1012}, "color_scheme": "dark"}, None),
    "web_phone": (FIRST, 1.9, {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "has_touch": True,
                               "is_mobile": True}, None),
}


@contextlib.contextmanager
def page_served():
    """Serve the page on a free port; give its address."""
    process = subprocess.Popen([sys.executable, "-m", "servotwin", "web", "--port", "0", "--no-open", "--json"],
                               stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        text = ""
        for line in process.stdout:
            text += line
            with contextlib.suppress(ValueError):
                address = json.loads(text)["page"]
                break
        yield address
    finally:
        process.terminate()
        process.wait(10)
        process.stdout.close()


def picture(browser, address, name):
    """Let a bench run to a time, and write what the page shows then."""
    scene, time, options, clip = PICTURES[name]
    context = browser.new_context(bypass_csp=True, **options)  # to wait for conditions
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector("body.ready")
    page.evaluate("(text) => bench.ask({scene: text})", scene)
    page.wait_for_function("(n) => bench.facts.length === n && bench.time > 0.1", arg=scene.count("id = "))
    page.wait_for_function(f"bench.time >= {time}", timeout=20000)
    page.evaluate("bench.ask({speed: 1e-3})")  # so that all that is drawn is of one instant
    page.wait_for_timeout(800)
    path = IMAGES / f"{name}.png"
    page.screenshot(path=path, clip=clip)
    context.close()
    Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    if path.stat().st_size > LARGEST:
        raise SystemExit(f"{path.name} has {path.stat().st_size} bytes, more than {LARGEST}")


def main():
    if CHROMIUM is None:
        raise SystemExit("no Chromium on this computer")
    with page_served() as address, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        for name in PICTURES:
            picture(browser, address, name)
        browser.close()


if __name__ == "__main__":
    main()
