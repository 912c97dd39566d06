"""Where the page's key is checked: another origin, a rebound name or a program without the key moves nothing."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping

KEY, TAB = "X-Armkin-Key", "X-Armkin-Tab"


class RefusedError(Exception):
    """A request that is answered with an HTTP status and a sentence, and does nothing."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Guard:
    """One run's key, and the names under which the page is served."""

    def __init__(self, port: int) -> None:
        self.key = secrets.token_urlsafe(24)
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._origins = {f"http://{host}" for host in self._hosts}

    def check_read(self, headers: Mapping[str, str], *, page: bool = False) -> None:
        """A GET: the Host must be ours (a rebound name is not), and no other origin may ask; page: for the page."""
        if headers.get("Host", "").lower() not in self._hosts:
            raise RefusedError(403, "this server answers to 127.0.0.1 and localhost only")
        if headers.get("Origin", next(iter(self._origins))).lower() not in self._origins:
            raise RefusedError(403, "another origin may not ask")
        # A form or an image of another site sends no Origin; browsers say this instead. A link that opens the page
        # itself, as the file does that `armkin teach` opens, gives its site nothing to read.
        opens = headers.get("Sec-Fetch-Mode") == "navigate" and headers.get("Sec-Fetch-Dest") == "document"
        if headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none") and not (page and opens):
            raise RefusedError(403, "another site may not ask")

    def check_action(self, headers: Mapping[str, str]) -> None:
        """A POST: as a GET, with our Origin, this run's key and JSON."""
        self.check_read(headers)
        if "Origin" not in headers:
            raise RefusedError(403, "an action needs the page's Origin")
        if not hmac.compare_digest(headers.get(KEY, "").encode("latin-1", "replace"), self.key.encode()):
            raise RefusedError(403, "an action needs this run's key: open the address that armkin teach printed")
        if headers.get("Content-Type", "").split(";")[0].strip().lower() != "application/json":
            raise RefusedError(415, "actions are application/json")
