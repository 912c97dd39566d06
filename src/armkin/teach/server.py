"""The HTTP server on 127.0.0.1: files of the page, a stream of events, actions.

Each answer is one write: with headers and body apart, Nagle's algorithm and delayed acknowledgements would cost 40 ms.
"""

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
_MAX_STRANGERS = 100  # most connections without the key; the oldest is closed
_LOOK_PERIOD = 0.1  # time [s] between two checks for a closed page
_SILENCE_TIME = 15.0  # time [s] after which an event stream sends a comment, to detect dead connections


class Server(ThreadingHTTPServer):
    """The server of one arm's page."""

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
        """The address for a browser, with the key in the fragment, which browsers do not send."""
        return f"http://127.0.0.1:{self.server_address[1]}/#{self.guard.key}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a new connection, and close the oldest one without the key if there are too many."""
        with self._lock:
            self._strangers[id(request)] = request
            while len(self._strangers) > _MAX_STRANGERS:
                _, oldest = self._strangers.popitem(last=False)
                _shut_down(oldest)
        super().process_request(request, client_address)

    def accept(self, request: Any) -> None:
        """Mark a connection that has shown the key, so that it is not closed for others."""
        with self._lock:
            self._strangers.pop(id(request), None)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self.accept(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing for a broken connection; `_Handler` answers errors of actions."""


def _shut_down(connection: socket.socket) -> None:
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        return  # the page was closed already


@cache
def served_files() -> dict[str, tuple[str, bytes]]:
    """{path: (kind, content)} of every file that is served."""
    file_of_path = {}
    for path in sorted(STATIC.rglob("*")):
        if path.suffix in _KINDS:
            file_of_path["/" + path.relative_to(STATIC).as_posix()] = (_KINDS[path.suffix], path.read_bytes())
    return file_of_path


class _Handler(BaseHTTPRequestHandler):
    """Answers the requests of one connection."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1  # buffer an answer for a single write
    timeout = 60.0
    server: Server

    def do_GET(self) -> None:
        """Answer a GET with a file, or the stream of events."""
        self._serve_guarded(self._serve_get)

    def do_POST(self) -> None:
        """Carry out the action of a POST."""
        self._serve_guarded(self._serve_post)

    def _serve_guarded(self, serve: Callable[[], None]) -> None:
        try:
            serve()
        except RefusedError as error:
            self.close_connection = True  # the request's body may still arrive
            self._send_json(error.status, {"error": str(error), "kind": "refused"})
        except OSError:
            self.close_connection = True

    def _serve_get(self) -> None:
        """Send a file of the page, or the stream of events."""
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
        """Carry out an action of the page, and send its answer or error as JSON."""
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
        """Send events to a page until it is closed, which shows as the end of its connection."""
        tab = self.server.actions.tabs.find(query.removeprefix("tab="))
        self.server.actions.tabs.enter(tab)
        self.server.accept(self.connection)
        self.close_connection = True
        try:
            self._send_head(200, "text/event-stream", "")
            self.end_headers()
            self.wfile.write(b"retry: 1000\n\n")
            self.wfile.flush()
            silence = 0.0
            while not self._is_gone():
                messages = tab.hear(_LOOK_PERIOD)
                silence = 0.0 if messages else silence + _LOOK_PERIOD
                for topic, message in messages.items():
                    text = json.dumps(message, allow_nan=False)
                    self.wfile.write(f"event: {topic}\ndata: {text}\n\n".encode())
                if silence >= _SILENCE_TIME:
                    self.wfile.write(b":\n\n")
                    silence = 0.0
                self.wfile.flush()
        finally:
            self.server.actions.tabs.close_tab(tab)

    def _is_gone(self) -> bool:
        readable, _, _ = select.select([self.connection], [], [], 0)
        return bool(readable) and not self.connection.recv(1, socket.MSG_PEEK)

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
        """The value of the Server header."""
        return "armkin"

    def log_message(self, *_: Any) -> None:
        """Print nothing for a request."""


def _single_headers(handler: BaseHTTPRequestHandler) -> dict[str, str]:
    """Headers by their canonical names. Raises RefusedError for a duplicate of an important one."""
    headers: dict[str, str] = {}
    for name, value in handler.headers.items():
        key = name.title()
        if key in headers and key in ("Host", "Origin", "Content-Length", KEY):
            raise RefusedError(400, f"{key} is there twice")
        headers[key] = value
    return headers


def _content_policy(nonce: str) -> str:
    """The content security policy: only our own files, and scripts with this answer's nonce."""
    scripts = f"'nonce-{nonce}'" if nonce else "'none'"
    return (
        f"default-src 'none'; script-src {scripts}; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
