"""Frames in sequence: go-back-N, with credit in segments and in bytes (firmware/PROTOCOL.md, section 3).

Submitted frames are sent in order, kept until they are acknowledged, and sent again if they are not. The board executes
a frame at most once, no matter how often it is sent.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice

from armkin.board.firmware.wire import protocol, reply_checks
from armkin.board.firmware.wire.protocol import Ack, Error, Info, Status
from armkin.board.firmware.wire.serial_line import Line

_RESEND_TIMEOUT = 0.03  # time [s] without progress, beyond the slowest answer, after which frames are sent again
_GAP_TIME = 0.004  # the same after a known loss
_ASK_DELAY = 0.012  # time [s] without progress after which the status is requested
_NOISY_RESEND = 0.002  # the same on a bad line, where waiting is useless
_MAX_FRAMES = (1, 16)  # most unacknowledged frames, on a bad and on a good line
_MAX_BYTES = (240, 700)  # most unacknowledged bytes, on a bad and on a good line
QUESTION_BYTES = 12  # size [bytes] of a STATUS? on the line


@dataclass
class _Frame:
    """A frame that is kept until the board has acknowledged it; make: its bytes for a sequence number."""

    make: Callable[[int], bytes]
    segments: int
    seconds: float  # seconds of motion


class Window:
    """The frames that are not acknowledged yet, and the credit of the board."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._waiting: deque[_Frame] = deque()  # frames that are not sent yet
        self._sent: deque[tuple[_Frame, bytes]] = deque()  # frames that are not acknowledged yet
        self._next = 0  # sequence number of the first of them
        self._free = 0
        self._receive = 0
        self._gap = False  # whether the first sent frame is known to be lost
        self._sent_at = 0.0  # time of the last frame written
        self._deaf = 0.0  # until this time an answer may belong to frames before the last going back
        self._bytes = _MAX_BYTES[1]  # bytes that may be unacknowledged

    def begin(self, info: Info) -> None:
        """Begin a new session without unacknowledged frames and with an empty queue."""
        self._waiting.clear()
        self._sent.clear()
        self._next, self._free, self._receive = 0, info.queue, info.receive
        self._gap = False

    def clear(self) -> None:
        """Drop the frames that are not sent yet."""
        self._waiting.clear()

    def submit(self, make: Callable[[int], bytes], segments: int, seconds: float) -> None:
        """Put a frame in line; make: its payload for a sequence number; segments: credit that it takes."""
        self._waiting.append(_Frame(make, segments, seconds))

    def __len__(self) -> int:
        """Frames that are not acknowledged."""
        return len(self._waiting) + len(self._sent)

    @property
    def backlog(self) -> int:
        """Frames that wait to be sent."""
        return len(self._waiting)

    @property
    def out_of_credit(self) -> bool:
        """Whether frames wait for credit and no unacknowledged frame will bring any."""
        return bool(self._waiting) and not self._sent

    @property
    def seconds(self) -> float:
        """Seconds of motion that are not acknowledged."""
        return sum(frame.seconds for frame in self._waiting) + sum(frame.seconds for frame, _ in self._sent)

    def send(self) -> None:
        """Send new frames as far as credit and window allow, and send all again after a time without answers."""
        time = self._line.port.now()
        self._fill()
        margin = _GAP_TIME if self._gap else _RESEND_TIMEOUT
        timeout = _NOISY_RESEND if self._line.noisy else self._line.slowest + margin
        if self._sent and time - self._line.clear > timeout:
            self._go_back(0, len(self._sent[0][1]))
        elif self._gap and not self._line.noisy and time > self._deaf:
            # the answer to the second or a later frame showed the loss, so the third is the oldest without an answer
            bytes_behind = sum(len(frame_bytes) for _, frame_bytes in islice(self._sent, 3, None))
            if bytes_behind + len(self._sent[0][1]) <= self._receive - QUESTION_BYTES:
                self._go_back(bytes_behind, 0)

    @property
    def late(self) -> bool:
        """Whether an answer to what was sent should be here by now."""
        patience = self._line.slowest + (_GAP_TIME if self._line.has_damage else _ASK_DELAY)
        return bool(self._sent) and self._line.port.now() - self._line.clear > patience

    def _room(self, size: int, first: int) -> int:
        """Bytes that may be sent when `size` are under way, of which the first frame has `first`.

        What follows the frame that the board is busy with must fit into its receive buffer, a STATUS? included.
        """
        return min(self._bytes, first + self._receive - QUESTION_BYTES) - size

    @property
    def credit(self) -> int:
        """Segments that the queue takes beyond those that are sent or wait here."""
        return self._credit - sum(frame.segments for frame in self._waiting)

    @property
    def _credit(self) -> int:
        return self._free - sum(frame.segments for frame, _ in self._sent)

    def _fill(self) -> None:
        """Send waiting frames as far as the board's credit, the window and its receive buffer have room."""
        credit = self._credit
        size = sum(len(frame_bytes) for _, frame_bytes in self._sent)
        max_frames = _MAX_FRAMES[0 if self._line.noisy else 1]
        while self._waiting and len(self._sent) < max_frames:
            if self._waiting[0].segments > credit:
                return
            frame_bytes = protocol.encode_frame(self._waiting[0].make((self._next + len(self._sent)) & 255))
            first = len(self._sent[0][1]) if self._sent else len(frame_bytes)
            room = self._room(size, first)
            if self._sent and len(frame_bytes) > room:
                return
            frame = self._waiting.popleft()
            self._sent.append((frame, frame_bytes))
            self._sent_at = self._line.port.now()
            credit -= frame.segments
            size += self._line.write_frame(frame_bytes, room)

    def _go_back(self, size: int, first: int) -> None:
        """Go back to the first frame that was not acknowledged.

        size: unacknowledged bytes behind the oldest frame; first: bytes of that frame that need not fit the buffer.
        """
        self._gap = False
        self._bytes = _MAX_BYTES[0] if self._line.noisy else max(_MAX_BYTES[0], self._bytes // 2)
        self._sent_at = self._line.port.now()
        self._deaf = max(self._sent_at, self._line.clear) + self._line.slowest + _GAP_TIME
        self._line.write(b"\0")
        for number, (_, frame_bytes) in enumerate(self._sent):
            room = self._room(size, first)
            if number and len(frame_bytes) > room:
                break  # later frames would have to wait for it
            self._line.resent += 1
            size += self._line.write_frame(frame_bytes, room)

    def check(self, reply: Ack | Status) -> None:
        """Raise BoardSaysError for a `next` that runs ahead of what was sent, or back behind what was acknowledged."""
        reply_checks.check_next((reply.next - self._next) & 255, len(self._sent), self._line.port.name)

    def acknowledge(self, reply: Ack | Status, time_asked: float = 0.0) -> int:
        """Process a reply's `next` and `free`, and count the frames that it acknowledges; time_asked: its request's."""
        count = (reply.next - self._next) & 255
        if count > len(self._sent):
            return 0
        for _ in range(count):
            self._sent.popleft()
        self._next, self._free = reply.next, reply.free
        if count:
            self._line.clear, self._gap = max(self._line.clear, self._line.port.now()), False
            self._bytes = _MAX_BYTES[0] if self._line.noisy else min(_MAX_BYTES[1], self._bytes + 20)
        elif self._sent and (
            type(reply) is Ack or time_asked > self._sent_at or (reply.detail == Error.SPILL and not reply.error)
        ):
            self._gap = True  # a later frame has arrived and the first has not
        return count
