"""Benches of the page as one file in the browser itself: the numbers and words of the server."""

import json
from pathlib import Path

import pytest

from bench_compare import compare

pytestmark = pytest.mark.slow
PLAY = Path(__file__).parents[1] / "alone" / "harness" / "play.mjs"
IN_PAGE = """async ([text, jobs]) => {
  const { play } = await import(`data:text/javascript,${encodeURIComponent(text)}`);
  const parts = await Promise.all(["kernel", "live", "check", "scene"].map((one) => import(`bench/${one}.js`)));
  const { module, world } = globalThis.servotwin;
  const found = play(Object.assign({}, ...parts), module, world, jobs, () => performance.now() / 1000);
  return JSON.stringify(found, (_, x) => (typeof x === "number" && !Number.isFinite(x) ? String(x) : x));
}"""


def test_sixty_benches_in_the_browser(opened, bench_file):
    page = opened(bench_file)
    page.evaluate("bench.ask({run: false})")

    def benches(jobs):
        return json.loads(page.evaluate(IN_PAGE, [PLAY.read_text(), jobs]))

    refused, moved = compare(benches, range(2000, 2060))
    assert refused > 30
    assert moved > 45
