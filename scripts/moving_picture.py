"""Writes docs/teach.gif, the README's moving picture: a UR5e's tip goes round a circle, all branches follow.

    python scripts/moving_picture.py [FILE.gif]

The page is what `armkin export ur5e --html` writes, and each frame a target that was typed into it: what is seen is
solved in the browser. Needs what the tests need (Debian's chromium, Playwright, and Pillow, which matplotlib brings).
"""

from __future__ import annotations

import io
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

ROOT = Path(__file__).parents[1]
FRAMES, PERIOD = 48, 4.0  # and seconds a round
SIZE, WIDTH = ViewportSize(width=1180, height=640), 800  # of the window; of the picture, in pixels
CENTRE, RADIUS = (-540.0, -330.0, 480.0), 130.0  # of the tip's circle [mm], which leans towards the base
POSTURE = "20,-70,80,-60,70,10"  # [deg], where the loop begins


def target(share: float) -> tuple[float, float, float]:
    """The tip after a share of the round [mm]."""
    turn = 2 * math.pi * share
    across, up = RADIUS * math.cos(turn), RADIUS * math.sin(turn)
    return CENTRE[0] + 0.6 * across, CENTRE[1] - 0.8 * across, CENTRE[2] + up


def frame(page: Page, share: float) -> Image.Image:
    """The page with its tip there, as small as the picture is."""
    for box, number in zip(page.locator("#target input").all(), target(share), strict=False):
        box.fill(f"{number:.3f}")
    page.keyboard.press("Tab")
    page.evaluate("document.activeElement.blur()")
    while page.evaluate("document.documentElement.dataset.asking !== 'no'"):
        page.wait_for_timeout(20)
    while page.evaluate("document.querySelector('#canvas').dataset.coarse !== 'false'"):
        page.wait_for_timeout(20)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return shot.resize((WIDTH, round(shot.height * WIDTH / shot.width)), Image.Resampling.LANCZOS)


def main() -> None:
    picture = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/teach.gif"
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder) / "ur5e.html"
        subprocess.run(["armkin", "export", "ur5e", "--html", "-o", str(file)], check=True)
        drawing = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=drawing)
        page = browser.new_page(viewport=SIZE)
        page.goto(f"{file.as_uri()}#q={POSTURE}")
        page.wait_for_selector("html[data-ready]")
        page.click("[data-view=space]")
        frames = [frame(page, k / FRAMES) for k in range(FRAMES)]
        browser.close()
    # Few pixels have a branch's colour: of the palette's methods this one keeps colours that few pixels have.
    colours = frames[0].quantize(128, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    small = [one.quantize(palette=colours, dither=Image.Dither.NONE) for one in frames]
    small[0].save(
        picture, save_all=True, append_images=small[1:], duration=round(1000 * PERIOD / FRAMES), loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
