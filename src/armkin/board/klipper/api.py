"""Klipper's API server: requests and answers as JSON, each ended by the byte 0x03 (Klipper's docs/API_Server.md)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.ports import Port

END = b"\x03"  # byte that ends a message
_TIMEOUT = 5.0  # time [s] that a question may take
_MAX_BYTES = 4_000_000  # size [bytes], at most, of one answer


class KlipperError(LinkError):
    """Klipper has refused a request."""


class Api:
    """The API server behind an open port."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._last = 0
        self._text = b""
        self._answers: dict[int, dict[str, Any]] = {}
        self._waiting: set[int] = set()

    def ask(self, method: str, params: dict[str, Any] | None = None, patience: float = _TIMEOUT) -> dict[str, Any]:
        """A request and its result. Raises KlipperError if it is refused, LinkError if nothing comes."""
        number = self.send(method, params)
        deadline = self._port.now() + patience
        while number in self._waiting:
            if self._port.now() > deadline:
                self._waiting.discard(number)
                raise LinkError(f"Klipper on {self._port.name} did not answer {method} within {patience:g} s")
            self.pump(0.02)
        return self._take_result(number)

    def query(self, **objects: list[str]) -> dict[str, dict[str, Any]]:
        """Fields of printer objects: object -> field -> value. An object that is not there has none."""
        status = self.ask("objects/query", {"objects": objects}).get("status")
        fields_of = status if isinstance(status, dict) else {}
        return {name: fields if isinstance(fields := fields_of.get(name), dict) else {} for name in objects}

    def run(self, script: str, patience: float = _TIMEOUT) -> None:
        """Run lines of G-code, and wait until they are done."""
        self.ask("gcode/script", {"script": script}, patience)

    def send(self, method: str, params: dict[str, Any] | None = None) -> int:
        """A request whose answer is not waited for; its number."""
        self._last += 1
        request = {"id": self._last, "method": method, "params": params or {}}
        self._waiting.add(self._last)
        self._port.write(json.dumps(request).encode() + END)
        return self._last

    def count_waiting(self) -> int:
        """Requests without an answer. Raises KlipperError for those that were refused since."""
        for number in list(self._answers):
            self._take_result(number)
        return len(self._waiting)

    def pump(self, timeout: float) -> None:
        """Read what has come, or comes in so many seconds."""
        self._text += self._port.read(timeout)
        *messages, self._text = self._text.split(END)
        if len(self._text) > _MAX_BYTES:
            raise LinkError(f"{self._port.name} does not answer as Klipper's API server does")
        for part in messages:
            try:
                answer = json.loads(part)
            except (ValueError, RecursionError):
                answer = None
            if not isinstance(answer, dict):
                raise LinkError(f"{self._port.name} does not answer as Klipper's API server does")
            number = answer.get("id")
            if isinstance(number, int) and number in self._waiting:
                self._waiting.discard(number)
                self._answers[number] = answer

    def _take_result(self, number: int) -> dict[str, Any]:
        answer = self._answers.pop(number)
        if "error" in answer:
            error = answer["error"]
            message = error.get("message", error) if isinstance(error, dict) else error
            raise KlipperError(f"Klipper: {str(message).splitlines()[0] if str(message) else 'an error'}")
        fields = answer.get("result")
        return fields if isinstance(fields, dict) else {}
