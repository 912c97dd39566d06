"""A real browser without a window: Debian's Chromium, driven by Playwright, drawing in software."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, BrowserType, Page, sync_playwright

COUNTS = [361, -5411, 2898]  # of x 390, y 80, z 300, left, elbow up
# Chromium fills a menu of its own for every window, which takes as long as a page of ours. The last list of features
# counts, so that what Playwright switches off stands here, too.
_WITHOUT = (
    "WebUIOmniboxPopup",
    "WebUIOmniboxAimPopup",
    "WebUIOmniboxFullPopup",
    "SpareRendererForSitePerProcess",
    "AimEnabled",
    "AvoidUnnecessaryBeforeUnloadCheckSync",
    "DestroyProfileOnBrowserClose",
    "HttpsUpgrades",
    "LensOverlay",
    "MediaRouter",
    "NetworkTimeServiceQuerying",
    "OptimizationHints",
    "PaintHolding",
    "PreconnectToSearch",
    "ThirdPartyStoragePartitioning",
    "Translate",
)
_OPTIONS = (
    f"--disable-features={','.join(_WITHOUT)}",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
# For tests that do not look at the picture: WebGL does everything but the pixels, which take half of a test's time.
NO_PIXELS = "--disable-gl-drawing-for-tests"


@contextmanager
def chromium(*options: str) -> Iterator[Browser]:
    """The browser; there is no other in this process meanwhile, unless it is `launched`."""
    with sync_playwright() as playwright, launch_browser(playwright.chromium, *options) as browser:
        yield browser


@contextmanager
def launch_browser(kind: BrowserType, *options: str) -> Iterator[Browser]:
    """A browser of its own, with a new profile; kind: `browser_type` of one that runs."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    assert path, "no chromium: scripts/test installs it; or leave these tests out: -m 'not browser'"
    browser = kind.launch(executable_path=path, headless=True, args=[*_OPTIONS, *options], timeout=120_000)
    yield browser
    browser.close()


@contextmanager
def open_page(browser: Browser, address: str, **settings: object) -> Iterator[Page]:
    """A page, open and drawn; script: runs before the page's own; quiet: it complains of nothing. It must
    not ask another machine for anything."""
    viewport = settings.pop("viewport", {"width": 860, "height": 640})
    script, quiet = settings.pop("script", ""), settings.pop("quiet", True)
    context = browser.new_context(viewport=viewport, **settings)  # type: ignore[arg-type]
    page = context.new_page()
    page.add_init_script(str(script))
    page.set_default_timeout(120_000)
    console: list[str] = []
    requested: list[str] = []
    page.on("console", lambda message: console.append(message.text))
    page.on("pageerror", lambda error: console.append(str(error)))
    page.on("request", lambda request: requested.append(request.url))
    base = address.split("#")[0]
    page.goto(address)
    page.wait_for_selector("html[data-ready]")
    yield page
    context.close()
    # An action that is refused is told to the person, and by Chromium to its console, too.
    assert not quiet or [text for text in console if "Failed to load resource" not in text] == []
    assert [url for url in requested if not url.startswith((base, "data:", "blob:"))] == []


def box_value(page: Page, selector: str) -> float:
    """Number in a box."""
    return float(page.input_value(selector))


def box_values(page: Page, selector: str) -> list[float]:
    """Numbers in boxes."""
    return [float(box.input_value()) for box in page.locator(selector).all()]


def type_target(page: Page, *target: float) -> None:
    """Type the tip's target."""
    for box, number in zip(page.locator("#target input").all(), target, strict=True):
        box.fill(str(number))
    page.keyboard.press("Tab")
    wait_for_answers(page)


def wait_until(page: Page, condition: str, argument: object = None, seconds: float = 120.0) -> None:
    """Until an expression holds. (Playwright's own waiting evaluates text in the page, which its policy forbids.)"""
    end = time.monotonic() + seconds
    while not page.evaluate(f"argument => {condition}", argument):
        if time.monotonic() > end:
            shown = page.evaluate(
                "['standing', 'arrived', 'trouble'].map(id => document.getElementById(id).textContent)"
            )
            raise AssertionError(f"not within {seconds:g} s: {condition} ({argument}); the page says {shown}")
        page.wait_for_timeout(20)


def hold_jog(
    page: Page, press: Callable[[], None], release: Callable[[], None], has_arrived: Callable[[], object]
) -> None:
    """A jog's button is held until the board is there, and stays held. On a busy computer the page's signs of life come
    late, which ends the jog, or ended it before the button was held: it is pressed anew then, as a person would."""
    end = time.monotonic() + 120
    pressed = time.monotonic()
    press()
    while not has_arrived():
        assert time.monotonic() < end, page.inner_text("#standing") + page.inner_text("#trouble")
        unheard = time.monotonic() > pressed + 10 and not standing_text(page).startswith("jog")
        if unheard or "press again" in page.inner_text("#arrived"):
            release()
            pressed = time.monotonic()
            press()
        page.wait_for_timeout(20)


def standing_text(page: Page) -> str:
    """What the board does and whether its position is known, as the page says it."""
    return page.inner_text("#standing")


def wait_for_repaint(page: Page) -> None:
    """Until what was asked to be drawn by now has been drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def wait_for_answers(page: Page) -> None:
    """Until the page's answers have come: nothing is asked any more."""
    wait_until(page, "document.documentElement.dataset.asking === 'no'")


def wait_for_board(page: Page, after: str) -> None:
    """Until the board has ended what it was told."""
    wait_until(page, "document.querySelector('#arrived').textContent.includes(argument)", after)
