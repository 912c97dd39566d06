"""Attacks on the page's server: nothing but the page itself may act, and nothing brings the server down."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from served_page import Page, ask, carry_out_action, good_headers, port_number, serve_robot

from armkin.teach.server import Server
from least_time import least_seconds


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serve_robot() as running:
        yield running


@pytest.fixture
def actions_done(server: Server, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the actions that were carried out."""
    names: list[str] = []
    actions = server.actions
    before = actions.act

    def note_and_call(name: str, tab: str, fields: dict[str, Any]) -> dict[str, Any]:
        names.append(name)
        return before(name, tab, fields)

    monkeypatch.setattr(actions, "act", note_and_call)
    return names


def test_the_page_itself_may_act(server: Server, actions_done: list[str]) -> None:
    assert carry_out_action(server, "stop") == (200, {})
    assert actions_done == ["stop"]


ATTACKS: dict[str, tuple[dict[str, str | None], int]] = {
    "no key": ({"X-Armkin-Key": None}, 403),
    "wrong key": ({"X-Armkin-Key": "x" * 32}, 403),
    "a key that is no ASCII": ({"X-Armkin-Key": "\xe9" * 32}, 403),
    "another origin": ({"Origin": "https://example.com"}, 403),
    "another port": ({"Origin": "http://127.0.0.1:1"}, 403),
    "a null origin (sandboxed frame, file:)": ({"Origin": "null"}, 403),
    "no origin": ({"Origin": None}, 403),
    "a rebound host": ({"Host": "evil.example:80"}, 403),
    "a host with our name as a prefix": ({"Host": "127.0.0.1.evil.example"}, 403),
    "another site by fetch metadata": ({"Sec-Fetch-Site": "cross-site"}, 403),
    "a form": ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
    "text/plain, which needs no preflight": ({"Content-Type": "text/plain"}, 415),
    "no type": ({"Content-Type": None}, 415),
    "chunked": ({"Transfer-Encoding": "chunked"}, 411),
    "a length that is none": ({"Content-Length": "-1"}, 411),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_does_nothing(server: Server, actions_done: list[str], name: str) -> None:
    changes, expected = ATTACKS[name]
    headers = {**good_headers(server), **changes}
    body = b"{}" if "Transfer-Encoding" not in headers else b"2\r\n{}\r\n0\r\n\r\n"
    status, _, data = ask(server, "POST", "/api/stop", body, {k: v for k, v in headers.items() if v is not None})
    assert status == expected
    assert json.loads(data)["error"]
    assert actions_done == []


def test_the_key_of_another_run_does_nothing(server: Server, actions_done: list[str]) -> None:
    with serve_robot() as second_server:
        headers = {**good_headers(server), "X-Armkin-Key": second_server.guard.key}
        assert ask(server, "POST", "/api/stop", b"{}", headers)[0] == 403
    assert actions_done == []


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[]",
        b"1",
        b'{"q": NaN}',
        b'{"q": -Infinity}',
        b'{"q": 1e999}',
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"q": ' + b"9" * 5000 + b"}",
    ],
)
def test_a_body_that_is_no_json_object_is_refused(server: Server, actions_done: list[str], body: bytes) -> None:
    status, _, data = ask(server, "POST", "/api/stop", body, good_headers(server))
    assert status == 400
    assert "JSON" in json.loads(data)["error"]
    assert actions_done == []


def test_ten_megabytes_are_not_read(server: Server, actions_done: list[str]) -> None:
    headers = {**good_headers(server), "Content-Length": str(10 << 20)}
    status, _, _ = ask(server, "POST", "/api/stop", b"x" * 1000, headers)
    assert status == 413
    assert actions_done == []


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"q": 1},
        {"q": [0, 0]},
        {"q": [0, 0, "1"]},
        {"q": [0, 0, True]},
        {"q": [0, 0, 1e300]},
        {"q": [0, 0, 10**400]},
        {"q": [0, 0, 0], "target": [1]},
        {"q": [0, 0, 0], "target": "x"},
        {"q": [0, 0, 0], "target": [0] * 10_000},
        {"q": [0, 0, 0], "held": ["no such joint"]},
        {"q": [0, 0, 0], "held": [["q1"]]},
        {"q": [0, 0, 0], "held": ["q1", "q2", "q3"]},
        {"q": [0, 0, 0], "branch": 5},
        {"q": [0, 0, 0], "best": "yes"},
    ],
)
def test_fields_that_are_wrong_are_named(server: Server, fields: Any) -> None:
    page = Page(server)
    try:
        page.hear("control")
        page.act("take")
        status, answer = page.act("look", **fields)
        assert status == 422, answer
        assert answer["kind"] == "usage"
    finally:
        page.close()


def test_an_unknown_action_or_page_is_refused(server: Server) -> None:
    assert carry_out_action(server, "look", {}, tab="nobody")[0] == 410
    page = Page(server)
    assert page.act("no_such_action")[0] == 404
    page.close()


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/js/../../server.py", "/.git/config", "/index.html/", "//etc/passwd"]
)
def test_only_the_page_s_files_are_served(server: Server, path: str) -> None:
    assert ask(server, "GET", path)[0] == 404


def test_other_origins_read_nothing(server: Server) -> None:
    assert ask(server, "GET", "/", None, {"Host": "evil.example"})[0] == 403
    assert ask(server, "GET", "/", None, {"Origin": "https://evil.example"})[0] == 403
    assert ask(server, "GET", "/events?tab=x", None, {"Sec-Fetch-Site": "cross-site"})[0] == 403
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert ask(server, "GET", "/", None, link)[0] == 200  # it opens the page, and reads nothing of it
    assert ask(server, "GET", "/events?tab=x", None, link)[0] == 403
    assert ask(server, "GET", "/", None, {**link, "Sec-Fetch-Dest": "iframe"})[0] == 403
    assert ask(server, "GET", "/", None, {**link, "Host": "evil.example"})[0] == 403
    assert ask(server, "GET", "/events?tab=x")[0] == 410
    status, headers, _ = ask(server, "OPTIONS", "/api/stop", None, {"Origin": "https://evil.example"})
    assert status == 501
    assert not any(name.startswith("Access-Control") for name in headers)


def test_the_page_may_load_nothing_else_and_is_not_framed(server: Server) -> None:
    status, headers, data = ask(server, "GET", "/")
    assert status == 200
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["X-Content-Type-Options"] == "nosniff"
    policy = headers["Content-Security-Policy"]
    nonce = policy.split("'nonce-")[1].split("'")[0]
    assert data.count(f'nonce="{nonce}"'.encode()) == data.count(b"nonce=") >= 2
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    again = ask(server, "GET", "/")[1]["Content-Security-Policy"]
    assert again != policy


def test_a_thousand_connections_do_not_keep_the_page_out(server: Server, capfd: pytest.CaptureFixture[str]) -> None:
    page = Page(server)
    idle = []
    for k in range(1000):
        connection = socket.create_connection(("127.0.0.1", port_number(server)), timeout=60)
        connection.sendall(b"POST /api/stop HTTP/1.1\r\nHost: x\r\n" if k % 2 else b"")
        idle.append(connection)
        if len(idle) > 500:  # as many as a process may hold here; the server has closed most of them
            idle.pop(0).close()

    def take() -> None:
        assert page.act("take")[0] == 200
        assert ask(server, "GET", "/")[0] == 200

    assert least_seconds(take, 1.0, time.monotonic) < 1.0
    for connection in idle:
        connection.close()
    page.close()
    assert capfd.readouterr().err == ""


def test_two_pages_one_control(server: Server) -> None:
    first = Page(server)
    first.act("take")
    second = Page(server)
    assert second.hear("control")["holder"] == "another"
    status, answer = second.act("look", q=[0, 90, -90])
    assert (status, "control" in answer["error"]) == (409, True)
    assert second.act("stop")[0] == 200  # whoever watches may stop
    assert first.act("look", q=[10, 80, -80])[0] == 200
    assert second.hear("look")["q"] == pytest.approx([10, 80, -80])
    assert second.act("take")[0] == 200
    assert second.act("look", q=[0, 90, -90])[0] == 200
    assert first.act("look", q=[0, 90, -90])[0] == 409
    second.close()
    first.hear("control", lambda news: news["holder"] == "nobody")
    assert first.act("look", q=[0, 90, -90])[0] == 409  # control is never taken by itself
    assert first.act("take")[0] == 200
    first.close()


def test_a_fifth_page_is_told_to_wait(server: Server) -> None:
    pages = [Page(server) for _ in range(4)]
    status, answer = carry_out_action(server, "open")
    assert (status, "close one" in answer["error"]) == (429, True)
    for page in pages:
        page.close()
    Page(server).close()
