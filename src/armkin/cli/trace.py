"""`--trace`: what the logger `armkin.board` says, on stderr."""

from __future__ import annotations

from typing import Any


def switch(ctx: Any, parameter: Any, wanted: bool | None) -> None:
    """Listen to the logger for as long as this command runs."""
    if not wanted:
        return
    import logging
    import sys

    log, before = logging.getLogger("armkin.board"), logging.getLogger("armkin.board").level
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(asctime)s.%(msecs)03d %(levelname)s %(message)s", "%H:%M:%S"))
    log.addHandler(handler)
    log.setLevel(logging.DEBUG)

    def end() -> None:
        log.removeHandler(handler)
        log.setLevel(before)

    ctx.call_on_close(end)
