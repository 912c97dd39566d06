"""Measure the page: `python tests/bench/bench_teach.py [ROBOT...]`, from the project's folder.

CPU of the server for one drag event, time to its answer, of the shipped arms that are named or of all; in a browser
that draws in software, time from the pointer to the numbers on the page, and from the command to the first picture.
The bars: 3 ms (seven joints 5), 50 ms in the median, 1.5 s.
"""

from __future__ import annotations

import http.client
import json
import math
import os
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path += [str(ROOT / "tests/helpers"), str(ROOT / "tests/teach")]

from browser_page import chromium  # noqa: E402
from playwright.sync_api import Browser, ViewportSize  # noqa: E402

from armkin.robot_file import catalogue  # noqa: E402

EVENTS = 100
ROUNDS = 8  # the best one counts: the first ones may run while machine code is built
PAUSE = 2.5  # [s] between them
STARTS = 5
WINDOW: ViewportSize = {"width": 1440, "height": 900}
POSES: dict[str, list[float]] = {"three_dof": [10, 60, -60], "ur5e": [20, -70, 80, -60, 70, 10]}
WATCH = """() => {
  window.seen = []; window.moved = 0;
  addEventListener('pointermove', () => { window.moved = performance.now(); }, true);
  new MutationObserver(() => {
    if (window.moved) window.seen.push(performance.now() - window.moved);
    window.moved = 0;
  }).observe(document.querySelector('#panels'), { subtree: true, attributeFilter: ['aria-valuetext'] });
}"""

# The answer to a read of the canvas comes once the picture is drawn.
DRAWN = """() => {
  const gl = document.querySelector('#canvas').getContext('webgl2');
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}"""


@contextmanager
def run_teach(robot: str) -> Iterator[tuple[subprocess.Popen[str], str, float]]:
    """The process, its address, and when it was started."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "armkin", "teach", robot, "--no-open"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().strip(), began
    finally:
        process.terminate()
        process.communicate()


def process_cpu(process: subprocess.Popen[str]) -> float:
    """Seconds of CPU that a process has used (Linux)."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def print_events(robot: str) -> None:
    """Drag events without a browser."""
    with run_teach(robot) as (process, address, _):
        base, key = address.split("/#")
        host = base.removeprefix("http://")
        line = http.client.HTTPConnection(host)
        line.connect()
        line.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def act(name: str, tab: str = "", **fields: Any) -> Any:
            headers = {"Origin": base, "Content-Type": "application/json", "X-Armkin-Key": key, "X-Armkin-Tab": tab}
            line.request("POST", f"/api/{name}", json.dumps(fields), headers)
            return json.loads(line.getresponse().read())

        opened = act("open")
        tab, arm = opened["tab"], opened["scene"]
        news = http.client.HTTPConnection(host)
        news.request("GET", f"/events?tab={tab}")
        stream = news.getresponse()
        held = [arm["lock"]] if arm["lock"] else []
        q = POSES.get(robot) or [_value_within(joint, 0.62 - 0.07 * i) for i, joint in enumerate(arm["joints"])]
        target = act("look", tab, q=q, held=held).get("target")
        if target is None:
            print(f"{robot:14} has no task")
            return
        rounds = []
        for _ in range(ROUNDS if robot not in POSES else 3):
            times, begun = [], process_cpu(process)
            for k in range(EVENTS):
                moved = [target[0] + 10 * math.sin(k / 20), target[1] + 5 * math.cos(k / 15), *target[2:]]
                since = time.perf_counter()
                branch_count = len(act("look", tab, q=q, target=moved, held=held, nearest=False)["branches"])
                times.append(time.perf_counter() - since)
            rounds.append(((process_cpu(process) - begun) / EVENTS, statistics.median(times)))
            time.sleep(PAUSE)
        stream.close()
        used, median = min(rounds)
        spent = f"{1e3 * used:.2f} ms CPU an event (the first {EVENTS}: {1e3 * rounds[0][0]:.2f})"
        print(f"{robot:14} {branch_count} branches: {spent}, {1e3 * median:.2f} ms to the answer", flush=True)


def _value_within(joint: dict[str, Any], share: float) -> float:
    low, high = (joint["lower"] or -180.0, joint["upper"] or 180.0)
    return float(low + share * (high - low))


def print_starts(robot: str, browser: Browser) -> None:
    """From the command to the first picture, in a browser that runs already and has an empty page open."""
    seconds = []
    for _ in range(STARTS):
        view = browser.new_page(viewport=WINDOW)
        with run_teach(robot) as (_, address, began):
            view.goto(address, wait_until="commit")
            view.wait_for_selector("html[data-ready]", state="attached")
            view.evaluate(DRAWN)
            seconds.append(time.perf_counter() - began)
        view.close()
    print(f"{robot:10} command to first picture: median {statistics.median(seconds):.2f} s, best {min(seconds):.2f} s")


def print_drags(robot: str, browser: Browser) -> None:
    """Drag the handle in a browser."""
    with run_teach(robot) as (_, address, _):
        view = browser.new_page(viewport=WINDOW)
        view.goto(address)
        view.wait_for_selector("html[data-ready]")
        view.evaluate(WATCH)
        for k, angle in enumerate(POSES[robot]):  # home may be singular, with one branch
            view.fill(f"#box-{k}", str(angle))
        view.keyboard.press("Tab")
        view.click("[data-view=front]")
        view.wait_for_timeout(300)
        x, y = map(float, (view.get_attribute("#canvas", "data-handle") or "").split())
        box = view.locator("#canvas").bounding_box()
        assert box is not None
        x, y = x + box["x"], y + box["y"] - 45
        view.mouse.move(x, y)
        view.wait_for_timeout(200)
        view.mouse.down()
        for k in range(60):
            view.mouse.move(x, y - 25 * math.sin(k / 8))
            view.wait_for_timeout(60)
        ghosts = len(view.locator("#branches button").all()) - 1
        view.mouse.up()
        delays = sorted(view.evaluate("window.seen"))
        median, late = statistics.median(delays), delays[int(0.95 * len(delays))]
        figures = f"median {median:.0f} ms, p95 {late:.0f} ms"
        print(f"{robot:10} pointer to numbers, {len(delays)} moves, {ghosts} ghosts: {figures}")
        view.close()


if __name__ == "__main__":
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for name in sys.argv[1:] or catalogue.robot_names():
        print_events(name)
    with chromium() as one:
        for name in POSES:
            if not sys.argv[1:] or name in sys.argv[1:]:
                print_starts(name, one)
                print_drags(name, one)
