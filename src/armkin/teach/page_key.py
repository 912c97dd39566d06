"""Access control: requests of another origin, a rebound name or a program without the key are refused."""

import hmac
import secrets
from collections.abc import Mapping

KEY, TAB = "X-Armkin-Key", "X-Armkin-Tab"


class RefusedError(Exception):
    """Raised for a request that is refused with an HTTP status and a sentence."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Guard:
    """The key of one run, and the host names of the page."""

    def __init__(self, port: int) -> None:
        self.key = secrets.token_urlsafe(24)
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._origins = {f"http://{host}" for host in self._hosts}

    def check_read(self, headers: Mapping[str, str], *, page: bool = False) -> None:
        """Check a GET: its Host must be ours, not a rebound name, its origin the page's; page: it asks for the page."""
        if headers.get("Host", "").lower() not in self._hosts:
            raise RefusedError(403, "this server answers to 127.0.0.1 and localhost only")
        if headers.get("Origin", next(iter(self._origins))).lower() not in self._origins:
            raise RefusedError(403, "another origin may not ask")
        # A form or an image of another site sends no Origin, but Sec-Fetch-Site. A link to the page itself, such as
        # that in the file that `armkin teach` opens, is allowed, since its site cannot read the answer.
        opens_page = headers.get("Sec-Fetch-Mode") == "navigate" and headers.get("Sec-Fetch-Dest") == "document"
        if headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none") and not (page and opens_page):
            raise RefusedError(403, "another site may not ask")

    def check_action(self, headers: Mapping[str, str]) -> None:
        """Check a POST: as a GET, and it needs our Origin, this run's key and JSON."""
        self.check_read(headers)
        if "Origin" not in headers:
            raise RefusedError(403, "an action needs the page's Origin")
        if not hmac.compare_digest(headers.get(KEY, "").encode("latin-1", "replace"), self.key.encode()):
            raise RefusedError(403, "an action needs this run's key: open the address that armkin teach printed")
        if headers.get("Content-Type", "").split(";")[0].strip().lower() != "application/json":
            raise RefusedError(415, "actions are application/json")
