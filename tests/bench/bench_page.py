"""Measure the page in one file beside the served one: `python tests/bench/bench_page.py [ROBOT...]`.

Every shipped arm, or those named: bytes and zipped bytes of its file, CPU of the whole `armkin export ROBOT --html`;
in one headless Chromium that draws in software, of the file and of the served page, the time from a slider's event to
all numbers of the tip and of every branch, and until the server has confirmed them: at home, where most wrists are
straight, and at a posture amid the limits. Two clocks: the wall's, and the processor's by the browser's own counter of
the page's thread. A busy machine lengthens the wall's as it likes, and the processor's by as much as it shares its
caches and cores: a fixed loop in the page's thread beside every event says by how much, against its own best. The bars:
1.5 MB, 450 kB, 2 s; 16 ms in the median, 40 ms for general arms of six joints.
"""

from __future__ import annotations

import gzip
import math
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
sys.path += [str(ROOT / "tests/helpers"), str(ROOT / "tests/teach")]

from browser_page import chromium  # noqa: E402
from playwright.sync_api import Browser, Page  # noqa: E402
from served_page import run_teach  # noqa: E402

import armkin  # noqa: E402
from armkin.robot_file import catalogue  # noqa: E402

EVENTS = 16
PAUSE = 60  # [ms] between them
# A fixed computation of some milliseconds; in a listener, as the browser counts no other scripts of ours.
LOOP = """() => {
  window.fixed ??= Object.assign(new EventTarget(), { sum: 0 });
  window.loop ??= () => { for (let k = 0; k < 4e5; k++) window.fixed.sum += Math.sqrt(k) * Math.sin(k); };
  window.fixed.addEventListener('go', window.loop, { once: true });
  window.fixed.dispatchEvent(new Event('go'));
}"""
AMID = """(values) => document.querySelectorAll('#sliders input[type=number]').forEach((box, i) => {
  box.value = values[i];
  for (const kind of ['input', 'change']) box.dispatchEvent(new Event(kind));
})"""
SLIDE = """async (k) => {
  const numbers = () => [...document.querySelectorAll('#target input')].map((box) => box.value).join();
  const tick = () => new Promise((done) => {
    const line = new MessageChannel();
    line.port1.onmessage = done;
    line.port2.postMessage(0);
  });
  const bar = document.querySelectorAll('#sliders input[type=range]')[1];
  const [low, high, before, began] = [+bar.min, +bar.max, numbers(), performance.now()];
  bar.value = low + (high - low) * (0.3 + 0.4 * ((k * 0.618) % 1));
  bar.dispatchEvent(new Event('input'));
  const atOnce = numbers() !== before;
  while (numbers() === before && performance.now() - began < 3000) await tick();
  window.slid = began;
  return [performance.now() - began, atOnce];
}"""
CONFIRMED = """async () => {
  const page = document.documentElement.dataset;
  while (page.asking === 'yes' && performance.now() - window.slid < 5000) await new Promise((done) => setTimeout(done));
  return performance.now() - window.slid;
}"""


class Slid(NamedTuple):
    """Milliseconds of a slider's event, medians of `EVENTS`."""

    wall: float  # until the numbers stand
    least: float
    processor: float  # of the page's thread until then; nan where they wait for the server
    alone: float  # the same, as if the fixed loop took its best time beside it
    confirmed: float


class Processor:
    """The processor's time of a page's scripts."""

    best = math.inf  # [ms] of the fixed loop, on this machine

    def __init__(self, page: Page) -> None:
        self.page = page
        self.meter = page.context.new_cdp_session(page)
        self.meter.send("Performance.enable", {"timeDomain": "threadTicks"})
        for _ in range(10):  # until the browser has compiled it
            self.loop()

    def scripts(self) -> float:
        """Milliseconds of scripts by now."""
        metrics = self.meter.send("Performance.getMetrics")["metrics"]
        return 1e3 * float(next(metric["value"] for metric in metrics if metric["name"] == "ScriptDuration"))

    def loop(self) -> float:
        """Milliseconds of the fixed loop."""
        began = self.scripts()
        self.page.evaluate(LOOP)
        used = self.scripts() - began
        Processor.best = min(Processor.best, used)
        return used


def slider_events(page: Page, processor: Processor) -> Slid:
    """A slider's events, one after another."""
    rows = []
    for k in range(EVENTS):
        page.wait_for_timeout(PAUSE)
        before = processor.loop()
        began = processor.scripts()
        wall, at_once = page.evaluate(SLIDE, k)
        used = processor.scripts() - began if at_once else math.nan
        confirmed = page.evaluate(CONFIRMED)
        rows.append((wall, used, used * 2 * Processor.best / (before + processor.loop()), confirmed))
    wall, used, alone, confirmed = map(statistics.median, zip(*rows, strict=True))
    return Slid(wall, min(row[0] for row in rows), used, alone, confirmed)


def slide_everywhere(browser: Browser, address: str, amid: list[float]) -> Iterator[Slid]:
    """At home, and at a posture amid the limits [deg | mm]."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(address)
    page.wait_for_selector("html[data-ready]", timeout=120_000)
    processor = Processor(page)
    yield slider_events(page, processor)
    page.evaluate(AMID, amid)
    page.wait_for_timeout(5 * PAUSE)
    yield slider_events(page, processor)
    page.close()


def export_cpu(name: str, file: Path) -> float:
    """Seconds of CPU of the whole process that writes the file."""
    began = getrusage(RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "armkin", "export", name, "--html", "-o", str(file)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    ended = getrusage(RUSAGE_CHILDREN)
    return ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime


def print_arm(browser: Browser, name: str, folder: Path) -> None:
    """One arm's rows."""
    arm = armkin.load(name)
    shares = [0.62 - 0.07 * i for i in range(arm.n)]
    turn = [arm.reach / 4 if slides else math.pi for slides in arm.prismatic]
    ends = [(max(low, -t), min(high, t)) for low, high, t in zip(arm.lower, arm.upper, turn, strict=True)]
    values = [low + share * (high - low) for share, (low, high) in zip(shares, ends, strict=True)]
    amid = [v if slides else math.degrees(v) for v, slides in zip(values, arm.prismatic, strict=True)]
    file = folder / f"{name}.html"
    try:
        wrote = min(export_cpu(name, file) for _ in range(2))
        file_rows = list(slide_everywhere(browser, file.as_uri(), amid))
        size = f"{file.stat().st_size / 1e6:.2f} MB {len(gzip.compress(file.read_bytes())) / 1e3:.0f} kB {wrote:.2f} s"
    except subprocess.CalledProcessError as error:
        print(f"{name:14} {error.stderr.decode().strip().splitlines()[0]}", flush=True)
        return
    with run_teach(name) as address:
        served = list(slide_everywhere(browser, address, amid))
    print(f"{name:14} {size}", flush=True)
    for place, k in (("home", 0), ("amid limits", 1)):
        for page, rows in (("file", file_rows), ("served", served)):
            row = rows[k]
            cpu = f"processor {row.processor:.1f}, alone {row.alone:.1f}"
            later = f", confirmed {row.confirmed:.1f}" if page == "served" else ""
            line = f"{row.wall:6.1f} ms (least {row.least:.1f}; {cpu}){later}"
            print(f"    {place:11} {page:6} {line}", flush=True)


if __name__ == "__main__":
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with chromium() as one, tempfile.TemporaryDirectory() as place:
        for each in sys.argv[1:] or catalogue.robot_names():
            print_arm(one, each, Path(place))
    print(f"load {os.getloadavg()[0]:.1f}; the fixed loop at best {Processor.best:.1f} ms")
