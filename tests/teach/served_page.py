"""A page's server in this process, and requests to it as a browser or an attacker would make them."""

from __future__ import annotations

import http.client
import json
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import armkin
from armkin.teach.actions import Actions
from armkin.teach.server import Server
from command_line import ROOT

ENDS = "note: Ctrl-C ends it\n"
MOVES = "note: Ctrl-C ends it, after the arm has been stopped\n"


@contextmanager
def serve_actions(actions: Actions) -> Iterator[Server]:
    """A server of these actions, in a thread of its own."""
    server = Server(actions)
    thread = threading.Thread(target=lambda: server.serve_forever(poll_interval=0.05))
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
        actions.close()


@contextmanager
def serve_robot(robot: str | Path = "three_dof", board: str | None = None) -> Iterator[Server]:
    """The server of a robot of the project, or of a file; board: a port."""
    path = robot if isinstance(robot, Path) else ROOT / f"robots/{robot}.yaml"
    with serve_actions(Actions(armkin.load(str(path)), board)) as server:
        yield server


@contextmanager
def run_teach(*words: str) -> Iterator[str]:
    """`armkin teach` as a process of its own, as people start it; its address."""
    command = [sys.executable, "-m", "armkin", "teach", *words, "--no-open"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        assert process.communicate(timeout=60)[1] == (MOVES if "--port" in words else ENDS)
        assert process.returncode == 143


def port_number(server: Server) -> int:
    return int(server.server_address[1])


def ask(
    server: Server, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None
) -> tuple[int, dict[str, str], bytes]:
    """One request; status, headers, body."""
    connection = http.client.HTTPConnection("127.0.0.1", port_number(server), timeout=60)
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, {name.title(): value for name, value in answer.getheaders()}, answer.read()
    finally:
        connection.close()


def good_headers(server: Server, tab: str = "") -> dict[str, str]:
    """Headers as the page sends them."""
    return {
        "Origin": f"http://127.0.0.1:{port_number(server)}",
        "Content-Type": "application/json",
        "X-Armkin-Key": server.guard.key,
        "X-Armkin-Tab": tab,
    }


def carry_out_action(server: Server, name: str, fields: dict[str, Any] | None = None, tab: str = "") -> tuple[int, Any]:
    """An action as the page carries it out: status and answer."""
    status, _, data = ask(server, "POST", f"/api/{name}", json.dumps(fields or {}).encode(), good_headers(server, tab))
    return status, json.loads(data)


def _hear_news(events: http.client.HTTPResponse, topic: str, until: Callable[[Any], bool]) -> Any:
    """The next news of a topic in a stream of events that is as it shall be; AssertionError after a minute."""
    current, end = "", time.monotonic() + 60
    while time.monotonic() < end:
        line = events.readline().decode().rstrip("\n")
        if line.startswith("event: "):
            current = line[7:]
        elif line.startswith("data: ") and current == topic:
            answer = json.loads(line[6:])
            if until(answer):
                return answer
    raise AssertionError(f"no such news of {topic} within a minute")


class Page:
    """An open page without a browser: it listens, and acts."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.presses = 0  # of a jog's button
        for _ in range(600):  # pages that have just been closed are open still, for a moment
            status, self.opened = carry_out_action(server, "open")
            if status != 429:
                break
            time.sleep(0.1)
        assert status == 200, self.opened
        self.id = self.opened["tab"]
        self._connection = http.client.HTTPConnection("127.0.0.1", port_number(server), timeout=60)
        self._connection.request("GET", f"/events?tab={self.id}")
        self._events = self._connection.getresponse()
        assert self._events.status == 200

    def act(self, action: str, /, **fields: Any) -> tuple[int, Any]:
        return carry_out_action(self.server, action, fields, self.id)

    def press(self, **jog: Any) -> tuple[int, Any]:
        """A jog's button is pressed; unless it is held, the jog ends after 0.3 s."""
        self.presses += 1
        return self.act("jog", press=self.presses, **jog)

    def hold(self) -> None:
        assert self.act("jog_on", press=self.presses)[0] == 200

    def let_go(self) -> None:
        assert self.act("jog_end", press=self.presses)[0] == 200

    def jog(self, has_arrived: Callable[[Any], bool], **jog: Any) -> None:
        """A jog's button is held until the board's state is as it shall be, and stays held; it is pressed anew where
        its signs of life came late."""
        end = time.monotonic() + 100
        while not has_arrived(self.state()):
            assert time.monotonic() < end, self.state()
            if self.state()["doing"] == "jog":
                self.hold()
            else:
                assert self.press(**jog)[0] in (200, 409)  # 409: another jog still comes to rest
            time.sleep(0.03)

    def hear(self, topic: str, until: Callable[[Any], bool] = lambda data: True) -> Any:
        """The next news of a topic that is as it shall be."""
        return _hear_news(self._events, topic, until)

    def idle(self) -> Any:
        """The board's state once it has nothing to do."""
        board = self.server.actions.board
        assert board is not None
        end = time.monotonic() + 120
        while board.thread.doing or board.thread.stopping:
            assert time.monotonic() < end, board.thread.state()
            time.sleep(0.005)
        return board.thread.state()

    def state(self) -> Any:
        """The board's state, as pages are told it."""
        board = self.server.actions.board
        assert board is not None
        return board.thread.state()

    def clock(self) -> float:
        """Seconds that have passed for the board: a simulated one's time waits where the machine is late."""
        board = self.server.actions.board
        assert board is not None
        assert board.thread.link is not None
        return board.thread.link.now()

    def close(self) -> None:
        """As a browser closes a page: the connection ends."""
        self._events.close()
        self._connection.close()


class Elsewhere:
    """The page of a server in another process, by its address."""

    def __init__(self, address: str) -> None:
        self.base, _, self.key = address.partition("/#")
        self.tab = ""
        self.opened = self.act("open")
        self.tab = self.opened["tab"]

    def listen(self) -> Any:
        """Hold control, as a page that is open does; the board's state once it has nothing to do."""
        self.events = urllib.request.urlopen(f"{self.base}/events?tab={self.tab}", timeout=60)
        state = self.opened["board"]
        return self.hear(lambda state: not state["doing"]) if state["doing"] else state

    def hear(self, until: Callable[[Any], bool]) -> Any:
        """The next news of the board that is as it shall be."""
        return _hear_news(self.events, "board", until)

    def act(self, name: str, **fields: Any) -> Any:
        headers = {"Origin": self.base, "Content-Type": "application/json", "X-Armkin-Key": self.key}
        request = urllib.request.Request(
            f"{self.base}/api/{name}", json.dumps(fields).encode(), {**headers, "X-Armkin-Tab": self.tab}
        )
        for _ in range(1200):
            try:
                return json.load(urllib.request.urlopen(request))
            except urllib.error.HTTPError as error:
                if error.code != 409:
                    raise
                time.sleep(0.05)  # busy still
        raise AssertionError(f"{name}: busy all the time")
