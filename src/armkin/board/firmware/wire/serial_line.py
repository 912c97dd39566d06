"""The serial line between host and board: counts damage, measures answer times, and tracks unsent bytes."""

from collections.abc import Iterator

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Ack, Info, Status
from armkin.board.ports import Port

_COPIES = 3  # copies of frames on a bad line, and of important questions
_ANSWER_TIME = 0.03  # normal time [s] of an answer
_MIN_QUESTION_BYTES = 50  # least size [bytes] of a STATUS? and its answer
_ANSWER_TIMEOUT, _SPARE_TIME = 0.05, 0.012  # time [s] for an answer, and margin beyond twice the slowest one


class Line:
    """Frames over a port."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self.splitter = protocol.Splitter()
        self.resent = 0  # frames
        self.clear = 0.0  # time when all written bytes have left, and of the last acknowledgement
        self.slowest = 0.0  # longest measured time [s] of an answer, without its bytes
        self._written = 0  # frames in sequence
        self._asked_at: dict[int, float] = {}  # tag: time when its STATUS? was written

    @property
    def noisy(self) -> bool:
        """Whether so much is damaged that short frames, each sent several times, are faster."""
        damaged_frames = self.splitter.bad + self.resent
        return damaged_frames > max(1.0, 0.03 * self._written)

    @property
    def has_damage(self) -> bool:
        """Whether any frame was damaged or lost so far."""
        return self.splitter.bad + self.resent > 0

    @property
    def copies(self) -> int:
        """The number of copies of an important question."""
        return _COPIES if self.has_damage else 1

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self.port.write(data)
        self.clear = max(self.clear, self.port.now()) + len(data) * 10 / self.port.baud

    def write_frame(self, frame_bytes: bytes, room: int) -> int:
        """Send a frame, on a bad line as often as `room` bytes allow; the bytes written."""
        self._written += 1
        copies = max(1, min(_COPIES, room // len(frame_bytes))) if self.noisy else 1
        self.write(frame_bytes * copies)  # the board executes one copy
        return copies * len(frame_bytes)

    def replies(self, timeout: float) -> Iterator[Ack | Info | Status]:
        """The replies that have arrived, or arrive within `timeout` seconds."""
        for payload in self.splitter.feed(self.port.read(timeout)):
            reply = protocol.parse_reply(payload)
            if isinstance(reply, Ack | Info | Status):
                yield reply

    @property
    def unanswered_count(self) -> int:
        """The number of STATUS? written since the last one that was answered."""
        return len(self._asked_at)

    def note_status_request(self, tag: int) -> None:
        """Note that a STATUS? of this tag is being written."""
        self._asked_at[tag] = self.port.now()

    @property
    def patience(self) -> float:
        """The time [s] within which an answer to a STATUS? arrives if nothing was lost."""
        return min(_ANSWER_TIMEOUT, 2 * self.slowest + _SPARE_TIME) if self.slowest else _ANSWER_TIMEOUT

    def take_answer(self, tag: int) -> float:
        """The time of the request that a STATUS answers; a late answer delays `clear`, since the line is behind."""
        time_asked = self._asked_at.pop(tag, None)
        if time_asked is None:
            return 0.0
        self._asked_at = {t: time for t, time in self._asked_at.items() if time > time_asked}
        took = self.port.now() - time_asked
        self.slowest = max(self.slowest, took - _MIN_QUESTION_BYTES * 10 / self.port.baud)
        if took > _ANSWER_TIME:
            self.clear = max(self.clear, self.port.now() + took - _ANSWER_TIME)
        return time_asked
