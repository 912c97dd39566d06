"""Measure the page in one file beside the served one: `python tests/bench/bench_page.py [ROBOT...]`.

Every shipped arm, or those named: bytes and zipped bytes of its file, CPU to write it; in one headless Chromium that
draws in software the time from a slider's event to all numbers of the tip and of every branch, in the file and in the
served page, until the server has confirmed them; and the processor's time from the event to the numbers, by the
browser's own counter of its page's thread, which no other process lengthens. The bars: 1.5 MB, 450 kB, 2 s; 16 ms in
the median, 40 ms for general arms of six joints.
"""

from __future__ import annotations

import gzip
import math
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path += [str(ROOT / "tests"), str(ROOT / "tests/teach")]

from browsing import chromium  # noqa: E402
from playwright.sync_api import Browser, Page  # noqa: E402
from served import teaching  # noqa: E402

import armkin  # noqa: E402
from armkin.errors import UsageError  # noqa: E402
from armkin.robot_file import catalogue  # noqa: E402
from armkin.teach.one_file import html  # noqa: E402

EVENTS = 30
SLIDE = """async (count) => {
  const page = document.documentElement.dataset;
  const numbers = () => [...document.querySelectorAll('#target input')].map((box) => box.value).join();
  const tick = () => new Promise((done) => {
    const line = new MessageChannel();
    line.port1.onmessage = done;
    line.port2.postMessage(0);
  });
  const bar = document.querySelectorAll('#sliders input[type=range]')[1];
  const [low, high] = [+bar.min, +bar.max];
  const seen = [], confirmed = [];
  for (let k = 0; k < count; k++) {
    await new Promise((done) => setTimeout(done, 120));
    const before = numbers(), began = performance.now();
    bar.value = low + (high - low) * (0.3 + 0.4 * ((k * 0.618) % 1));
    bar.dispatchEvent(new Event('input'));
    while (numbers() === before && performance.now() - began < 3000) await tick();
    seen.push(performance.now() - began);
    while (page.asking === 'yes' && performance.now() - began < 5000) await tick();
    confirmed.push(performance.now() - began);
  }
  return [seen, confirmed];
}"""

AT_ONCE = """(k) => {
  const numbers = () => [...document.querySelectorAll('#target input')].map((box) => box.value).join();
  const bar = document.querySelectorAll('#sliders input[type=range]')[1];
  const [low, high, before] = [+bar.min, +bar.max, numbers()];
  bar.value = low + (high - low) * (0.3 + 0.4 * ((k * 0.618) % 1));
  bar.dispatchEvent(new Event('input'));
  return numbers() !== before;
}"""


def processor(page: Page) -> float:
    """Milliseconds of the page's thread for an event, until its numbers stand: the median; nan if they come later."""
    meter = page.context.new_cdp_session(page)
    meter.send("Performance.enable", {"timeDomain": "threadTicks"})

    def scripts() -> float:
        told = meter.send("Performance.getMetrics")["metrics"]
        return float(next(one["value"] for one in told if one["name"] == "ScriptDuration"))

    used, empty = [], []
    for k in range(EVENTS):
        page.wait_for_timeout(60)
        began = scripts()
        at_once = page.evaluate(AT_ONCE, k)
        used.append(1e3 * (scripts() - began) if at_once else math.nan)
        page.wait_for_timeout(60)
        began = scripts()
        page.evaluate("0")
        empty.append(1e3 * (scripts() - began))
    return statistics.median(used) - statistics.median(empty)


def slid(browser: Browser, address: str) -> tuple[float, float, float, float]:
    """Milliseconds from a slider's event to the numbers, median and least; until confirmed; of the processor."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    page.wait_for_selector("html[data-ready]", timeout=120_000)
    page.wait_for_timeout(300)
    seen, confirmed = page.evaluate(SLIDE, EVENTS)
    cpu = processor(page)
    page.close()
    return statistics.median(seen), min(seen), statistics.median(confirmed), cpu


def measure(browser: Browser, name: str, folder: Path) -> None:
    """One arm's row."""
    arm = armkin.load(name)
    try:
        html(arm)  # what is prepared once and kept, modules that are imported: a process writes one file
    except UsageError as error:
        print(f"{name:14} {str(error).splitlines()[0]}", flush=True)
        return
    began = time.process_time()
    text = html(armkin.load(name)).encode()
    wrote = time.process_time() - began
    file = folder / f"{name}.html"
    file.write_bytes(text)
    own, own_least, _, own_cpu = slid(browser, file.as_uri())
    with teaching(name) as address:
        served, least, confirmed, cpu = slid(browser, address)
    size = f"{len(text) / 1e6:.2f} MB {len(gzip.compress(text)) / 1e3:.0f} kB {wrote:.2f} s"
    times = f"file {own:.1f} ms (least {own_least:.1f}, processor {own_cpu:.1f}), "
    times += f"served {served:.1f} ({least:.1f}, {cpu:.1f}), confirmed {confirmed:.1f}"
    print(f"{name:14} {size}; {times}", flush=True)


if __name__ == "__main__":
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with chromium() as one, tempfile.TemporaryDirectory() as place:
        for each in sys.argv[1:] or catalogue.names():
            measure(one, each, Path(place))
