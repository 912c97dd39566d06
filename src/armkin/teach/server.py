"""HTTP on 127.0.0.1: the page's files, a stream of events, actions.

Each answer is written in one go: headers and body apart, with Nagle's algorithm and delayed acknowledgements,
would take 40 ms.
"""

from __future__ import annotations

import json
import secrets
import select
import socket
import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from armkin.errors import ArmkinError, LinkError
from armkin.teach import request_checks
from armkin.teach.actions import Actions
from armkin.teach.page_key import KEY, TAB, Guard, RefusedError

STATIC = Path(__file__).parent / "static"
_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
_MAX_STRANGERS = 100  # connections that have not shown the key, at most; beyond, the oldest one is closed
_LOOK_PERIOD = 0.1  # time [s] between two looks at whether a page is still there
_SILENCE_TIME = 15.0  # time [s] after which an event stream says something, so that dead lines are noticed


class Server(ThreadingHTTPServer):
    """One arm's page."""

    daemon_threads = True
    request_queue_size = 128

    def __init__(self, actions: Actions, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.actions = actions
        self.guard = Guard(self.server_address[1])
        self._strangers: OrderedDict[int, socket.socket] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def address(self) -> str:
        """What to open in a browser; the key is in the fragment, which browsers do not send."""
        return f"http://127.0.0.1:{self.server_address[1]}/#{self.guard.key}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a new connection; of too many that have shown no key, close the oldest."""
        with self._lock:
            self._strangers[id(request)] = request
            while len(self._strangers) > _MAX_STRANGERS:
                _, oldest = self._strangers.popitem(last=False)
                _shut_down(oldest)
        super().process_request(request, client_address)

    def accept(self, request: Any) -> None:
        """A connection has shown the key: it is not closed for others."""
        with self._lock:
            self._strangers.pop(id(request), None)

    def shutdown_request(self, request: Any) -> None:
        """A connection ends."""
        self.accept(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that breaks is nothing to print: `_Handler` answers what goes wrong in an action."""


def _shut_down(connection: socket.socket) -> None:
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        return  # the page is gone already


@cache
def served_files() -> dict[str, tuple[str, bytes]]:
    """Path -> kind and bytes of every file that is served; there are no others."""
    served = {}
    for path in sorted(STATIC.rglob("*")):
        if path.suffix in _KINDS:
            served["/" + path.relative_to(STATIC).as_posix()] = (_KINDS[path.suffix], path.read_bytes())
    return served


class _Handler(BaseHTTPRequestHandler):
    """Answers the requests of one connection."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1  # one write an answer
    timeout = 60.0
    server: Server

    def do_GET(self) -> None:
        """A file, or the stream of events."""
        self._serve_guarded(self._serve_get)

    def do_POST(self) -> None:
        """An action."""
        self._serve_guarded(self._serve_post)

    def _serve_guarded(self, serve: Callable[[], None]) -> None:
        try:
            serve()
        except RefusedError as error:
            self.close_connection = True  # the request's body may still be on the way
            self._send_json(error.status, {"error": str(error), "kind": "refused"})
        except OSError:
            self.close_connection = True

    def _serve_get(self) -> None:
        path, _, query = self.path.partition("?")
        self.server.guard.check_read(_single_headers(self), page=path == "/")
        if path == "/events":
            self._send_events(query)
            return
        kind, content = served_files().get("/index.html" if path == "/" else path, ("", b""))
        if not kind:
            raise RefusedError(404, "there is no such file")
        nonce = secrets.token_urlsafe(16)
        self._send_content(
            200, kind, content.replace(b"{{nonce}}", nonce.encode()) if kind == "text/html" else content, nonce
        )

    def _serve_post(self) -> None:
        headers = _single_headers(self)
        self.server.guard.check_action(headers)
        self.server.accept(self.connection)
        if not self.path.startswith("/api/"):
            raise RefusedError(404, "there is no such action")
        fields = request_checks.body_fields(self.rfile.read(request_checks.body_length(headers)))
        try:
            answer = self.server.actions.act(self.path.removeprefix("/api/"), headers.get(TAB, ""), fields)
        except ArmkinError as error:
            status = 502 if isinstance(error, LinkError) else 422
            self._send_json(status, {"error": error.message, "kind": error.kind})
        except RefusedError:
            raise
        except Exception as error:
            self._send_json(500, {"error": f"internal error: {error!r}: this is a bug in armkin", "kind": "internal"})
        else:
            self._send_json(200, answer)

    def _send_events(self, query: str) -> None:
        """Tell a page what happens, until it is closed: its connection ends, which is looked at all the time."""
        tab = self.server.actions.tabs.find(query.removeprefix("tab="))
        self.server.actions.tabs.enter(tab)
        self.server.accept(self.connection)
        self.close_connection = True
        try:
            self._send_head(200, "text/event-stream", "")
            self.end_headers()
            self.wfile.write(b"retry: 1000\n\n")
            self.wfile.flush()
            silent = 0.0
            while not self._is_gone():
                news = tab.hear(_LOOK_PERIOD)
                silent = 0.0 if news else silent + _LOOK_PERIOD
                for topic, message in news.items():
                    text = json.dumps(message, allow_nan=False)
                    self.wfile.write(f"event: {topic}\ndata: {text}\n\n".encode())
                if silent >= _SILENCE_TIME:
                    self.wfile.write(b":\n\n")
                    silent = 0.0
                self.wfile.flush()
        finally:
            self.server.actions.tabs.close_tab(tab)

    def _is_gone(self) -> bool:
        ready, _, _ = select.select([self.connection], [], [], 0)
        return bool(ready) and not self.connection.recv(1, socket.MSG_PEEK)

    def _send_json(self, status: int, value: Any) -> None:
        self._send_content(status, "application/json", json.dumps(value, allow_nan=False).encode(), "")

    def _send_content(self, status: int, kind: str, content: bytes, nonce: str) -> None:
        self._send_head(status, kind, nonce)
        self.send_header("Content-Length", str(len(content)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(content)

    def _send_head(self, status: int, kind: str, nonce: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind if kind == "text/event-stream" else f"{kind}; charset=utf-8")
        self.send_header("Content-Security-Policy", _content_policy(nonce))
        self.send_header("X-Frame-Options", "DENY")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Cross-Origin-Opener-Policy", "same-origin")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("Cache-Control", "no-store")

    def version_string(self) -> str:
        """What the Server header says."""
        return "armkin"

    def log_message(self, *_: Any) -> None:
        """Requests are not printed."""


def _single_headers(handler: BaseHTTPRequestHandler) -> dict[str, str]:
    """Headers by their canonical names; one that is there twice is refused."""
    headers: dict[str, str] = {}
    for name, value in handler.headers.items():
        key = name.title()
        if key in headers and key in ("Host", "Origin", "Content-Length", KEY):
            raise RefusedError(400, f"{key} is there twice")
        headers[key] = value
    return headers


def _content_policy(nonce: str) -> str:
    """What the page may load: our own files, and scripts with this answer's nonce."""
    scripts = f"'nonce-{nonce}'" if nonce else "'none'"
    return (
        f"default-src 'none'; script-src {scripts}; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
