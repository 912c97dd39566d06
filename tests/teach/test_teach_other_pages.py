"""Pages beside the one that holds the arm: another program's in the same browser, and a second one of ours."""

from __future__ import annotations

from pathlib import Path

from browser_page import open_page, type_target, wait_for_board, wait_until
from playwright.sync_api import Browser
from served_page import serve_robot


def test_another_page_of_the_browser_moves_nothing(browser: Browser, tmp_path: Path) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address) as page:
        base = server.address.split("/#")[0]
        acts: list[str] = []
        before = server.actions.act
        server.actions.act = lambda name, tab, fields: acts.append(name) or before(name, tab, fields)  # type: ignore[func-returns-value, method-assign, assignment]
        evil_page = page.context.browser.new_context().new_page()  # type: ignore[union-attr]
        evil = tmp_path / "evil.html"
        evil.write_text(
            f"""<body><iframe id=frame src="{base}/"></iframe>
            <form id=form method=post enctype="text/plain" action="{base}/api/stop" target=hidden>
            <input name='{{"q": "' value='"}}'></form><iframe name=hidden></iframe></body>"""
        )
        evil_page.goto(f"file://{evil}")
        tried = evil_page.evaluate(
            """async base => {
              const send = async (options) => {
                try { return (await fetch(base + "/api/stop", { method: "POST", body: "{}", ...options })).status; }
                catch (error) { return "refused"; }
              };
              const key = { "Content-Type": "application/json", "X-Armkin-Key": "guess" };
              document.getElementById("form").submit();
              const events = new EventSource(base + "/events?tab=guess");
              await new Promise((resolve) => { events.onerror = resolve; events.onopen = resolve; });
              return [await send({ headers: key }), (await send({ mode: "no-cors" })) || "opaque", events.readyState];
            }""",
            base,
        )
        assert tried[0] == "refused"
        assert tried[2] == 2  # closed
        evil_page.wait_for_timeout(300)
        frame = evil_page.frames[1]
        assert "three_dof" not in (frame.evaluate("document.body ? document.body.innerText : ''") or "")
        assert acts == []
        evil_page.context.close()


def test_two_pages_and_a_take_over_on_purpose(browser: Browser) -> None:
    with (
        serve_robot(board="sim") as server,
        open_page(browser, server.address) as first,
        open_page(browser, server.address) as second,
    ):
        wait_until(second, "document.querySelector('#control').textContent.includes('another page')")
        assert second.evaluate("document.querySelector('#panels').inert")
        type_target(first, 390, 80, 300)
        first.click("#record")
        first.wait_for_selector("#player:not([hidden])")
        wait_until(second, "document.querySelector('#name-0')")
        second.wait_for_timeout(300)
        assert second.inner_text("#trouble") == second.inner_text("#planned") == ""  # who watches asks for nothing
        first.fill("#speed", "5")
        wait_until(second, "document.querySelector('#box-0').value === '10.1529'")
        first.click("#send")
        wait_until(second, "document.querySelector('#standing').textContent.startsWith('send')")
        second.click("#stop")  # works in both
        wait_for_board(first, "stopped")
        second.click("#take")
        wait_until(first, "document.querySelector('#panels').inert")
        wait_until(second, "!document.querySelector('#panels').inert")
        second.wait_for_selector("#player:not([hidden])")  # whoever holds control has the plan
