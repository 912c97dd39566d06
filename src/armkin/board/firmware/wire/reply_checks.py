"""Checks that every field of a board's replies is in its range; an error ends the session."""

from armkin.board.firmware.wire.protocol import VERSION, Ack, Error, Info, State, Status
from armkin.errors import LinkError

_INFO: dict[str, tuple[int, int]] = {
    "axes": (1, 15),
    "switches": (0, 8),
    "rows": (0, 15),
    "queue": (8, 128),
    "frame": (100, 250),
    "receive": (64, 65_535),
    "min_interval": (65, 32_767),
    "clock": (1_000_000, 1_000_000_000),
    "boots": (1, 65_535),
}


class DeviceError(LinkError):
    """Raised when the board ends the session; `error` is its code, `detail` the axis, row or segment."""

    def __init__(self, error: int, detail: int, state: int) -> None:
        self.error = Error(error) if error in Error._value2member_map_ else Error.OK
        self.detail, self.state = detail, state
        super().__init__(f"the board refused: {self.error.name} ({error}), detail {detail}")


class ReplacedError(LinkError):
    """Raised when another program has opened a session with the board."""


class BoardSaysError(LinkError):
    """Raised for a value that no board with this firmware sends; fields: field, value."""


def _impossible_value_error(port: str, field: str, value: object, allowed: str) -> BoardSaysError:
    return BoardSaysError(
        f"the board on {port} answers {field} {value}, but only {allowed} is possible: its answers cannot be trusted\n"
        "flash the firmware that came with this armkin, or look for another program that uses the port",
        port=port,
        field=field,
        value=value,
    )


def other_version(port: str, version: int) -> LinkError:
    """The error for firmware with another version of the protocol."""
    return LinkError(
        f"the firmware of the board on {port} speaks protocol {version}, this armkin {VERSION}: nothing was moved\n"
        "armkin flash writes the firmware that came with this armkin (in a clone: make -C firmware flash BOARD=...)",
        port=port,
        board_protocol=version,
        protocol=VERSION,
    )


def check_info(info: Info, port: str) -> None:
    """Raise BoardSaysError for an INFO with an impossible value."""
    for field, (low, high) in _INFO.items():
        value = getattr(info, field)
        if not low <= value <= high:
            raise _impossible_value_error(port, field, value, f"{low} to {high}")
    for field in ("known", "servos"):
        value = getattr(info, field)
        if value >> info.axes:
            raise _impossible_value_error(port, field, f"{value:#x}", f"{info.axes} axes")


def check_reply(reply: Ack | Status, info: Info, port: str) -> None:
    """Raise BoardSaysError for an ACK or STATUS with an impossible value."""
    if reply.state > max(State):
        raise _impossible_value_error(port, "state", reply.state, f"0 to {int(max(State))}")
    if reply.error > max(Error):
        raise _impossible_value_error(port, "error", reply.error, f"0 to {int(max(Error))}")
    if reply.free > info.queue:
        raise _impossible_value_error(port, "free", reply.free, f"0 to {info.queue}")
    if isinstance(reply, Status):
        if len(reply.counts) != info.axes:
            raise _impossible_value_error(port, "counts", len(reply.counts), str(info.axes))
        if reply.known >> info.axes:
            raise _impossible_value_error(port, "known", f"{reply.known:#x}", f"{info.axes} axes")
        if max(map(abs, reply.counts)) > 2**31 - 1:
            raise _impossible_value_error(port, "counts", max(map(abs, reply.counts)), "31 bits")


def check_session(digest: int, expected: int, port: str) -> None:
    """Raise ReplacedError if a reply belongs to another session than one's own."""
    if digest != expected:
        raise ReplacedError(
            f"another program has taken over the board on {port}: this one has ended\n"
            "only one program may move an arm; armkin status tells where it stands",
            port=port,
        )


def check_next(acknowledged_count: int, sent_count: int, port: str) -> None:
    """Raise BoardSaysError for a `next` that runs ahead of what was sent, or back behind what was acknowledged."""
    if acknowledged_count > sent_count:
        raise _impossible_value_error(port, "next", f"{acknowledged_count} ahead", f"0 to {sent_count}")
