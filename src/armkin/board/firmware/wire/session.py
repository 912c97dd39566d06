"""A session with a board: opening, frames in sequence, status and hold (firmware/PROTOCOL.md, section 3)."""

import secrets
from collections.abc import Callable, Iterator

from armkin.board.backend import StoppedError
from armkin.board.firmware.wire import protocol, reply_checks
from armkin.board.firmware.wire.go_back_n import Window
from armkin.board.firmware.wire.protocol import Ack, Error, Info, State, Status
from armkin.board.firmware.wire.reply_checks import DeviceError as DeviceError
from armkin.board.firmware.wire.reply_checks import ReplacedError as ReplacedError
from armkin.board.firmware.wire.serial_line import Line
from armkin.board.ports import Port, leave_boot_loader
from armkin.errors import LinkError

_POLL_PERIOD = 0.1  # time [s] between two STATUS?: the board holds after 0.5 s of silence
_NOISY_POLL_PERIOD = 0.025  # the same on a bad line, which loses some of them
_QUICK_POLL_PERIOD = 0.01  # the same while waiting for credit or for the end
_END_MILLISECONDS = 50  # the end is near when the queue holds less motion [ms]
_SILENCE_TIMEOUT = 1.5  # time [s] without any answer after which the board counts as disconnected
_MAX_TURN_WAIT = 0.1  # most time [s] of a turn that counts as silence: a suspended program hears nothing
_STATUS_TIMEOUT = 3.0  # time [s] of status requests without an answer
_MAX_UNANSWERED = 16  # most requests without an answer
_STALL_TIMEOUT = 5.0  # time [s] without progress beyond the motion in the queue
_HOLD_TIMEOUT = 15.0  # longest time [s] of a hold
_LISTEN_DELAY = 0.2  # time [s] after the opening by which a Mega's boot loader listens
_GREETING_TIME = 0.5  # time [s] in which a board answers that was not reset, or is a Mega
_BOOT_LOADER_TIME = 1.8  # time [s] after the opening by which every boot loader has ended
_BOOT_TIMEOUT = 5.0  # longest time [s] from the opening of a port to an answer
_MAX_JUNK_BYTES = 1000  # most bytes kept of foreign data
_PROBE_COUNT = 8  # requests that test a line


class Session:
    """A session with the board behind a port; a True from `stop`, which is called often, leads to a hold."""

    def __init__(self, port: Port, stop: Callable[[], bool] = lambda: False) -> None:
        self.port = port
        self.info: Info | None = None
        self.state = State.IDLE
        self.queued = 0  # [ms] in the last reply
        self.latest: Status | None = None  # last status
        self.line = Line(port)
        self._window = Window(self.line)
        self._stop = stop
        self._tag = 0
        self._digest = 0
        self._status: Status | None = None
        self.last: Ack | Status | None = None  # last reply
        self._error: Ack | Status | None = None
        self.attend()
        self.heard, self._silent_for = self._turn, 0.0  # [s] of silence
        self._last_request = 0.0
        self._until = 0.0  # deadline for progress

    # Opening

    def open(self) -> Info:
        """Open a session, waiting for a board that its opened port has reset.

        Raises LinkError if nothing answers, or something else than this protocol.
        """
        begin, nonce = self.port.now(), _new_nonce()
        heard, leave_times = bytearray(), [_LISTEN_DELAY, _BOOT_LOADER_TIME]
        while True:
            elapsed = self.port.now() - begin
            # Try first, then be silent for a listening boot loader, then try to the end.
            if leave_times and elapsed > leave_times[0]:
                leave_boot_loader(self.port)
                del leave_times[0]
                nonce = _new_nonce()  # a new session, as the board counts these bytes as damaged frames
            if elapsed < _GREETING_TIME or elapsed > _BOOT_LOADER_TIME:
                patience = 0.15 if elapsed < 3.0 else 0.4
                info = self._greet(nonce, 0.06 if elapsed < _GREETING_TIME else patience)
                if info is not None:
                    return info
            else:
                heard += self.port.read(0.05)[: _MAX_JUNK_BYTES - len(heard)]
            if self._stop():
                raise StoppedError
            if elapsed > _BOOT_TIMEOUT:
                raise _no_board(self.port, bytes(heard), self.line.splitter.bad > 0)

    def reopen(self) -> Info:
        """Open a new session after the last one ended with an error."""
        for _ in range(8):
            nonce = _new_nonce()  # accept a late answer to any of these requests
            for patience in (self.line.patience,) * 8 + (0.2,):
                info = self._greet(nonce, patience)
                if info is not None:
                    return info
        raise _silence_error(self.port)

    def _greet(self, nonce: int, timeout: float) -> Info | None:
        """Send HELLO and wait for INFO. Repeating a nonce is harmless, so an answer to an earlier one counts, too."""
        self._tag = (self._tag + 1) & 255
        self.port.write(b"\0" + protocol.encode_frame(protocol.hello(self._tag, nonce)) * self.line.copies)
        deadline = self.port.now() + timeout
        while self.port.now() < deadline:
            for payload in self.line.splitter.feed(self.port.read(max(0.001, deadline - self.port.now()))):
                version = protocol.info_version(payload)
                if version is not None and version != protocol.VERSION:
                    raise reply_checks.other_version(self.port.name, version)
                info = protocol.parse_reply(payload)
                if isinstance(info, Info) and info.nonce == nonce:
                    self._begin(info)
                    return info
        return None

    def _begin(self, info: Info) -> None:
        reply_checks.check_info(info, self.port.name)
        self.info = info
        self._digest = info.nonce & 0xFFFF
        self._window.begin(info)
        self._error = None
        self.heard, self._silent_for = self.port.now(), 0.0
        self._renew_patience()

    def _renew_patience(self) -> None:
        """Move the deadline for progress to the end of the queued motion and a margin."""
        self._until = self.port.now() + self.queued / 1000 + _STALL_TIMEOUT

    def _check_stalled(self) -> None:
        """Raise LinkError if the board has neither made progress nor come to rest by the deadline."""
        if self.port.now() > self._until:
            raise LinkError(
                f"the board on {self.port.name} answers, but its motion stays {State(self.state).name}\n"
                "if the arm moves, cut the motors' power; armkin status tells what the board says",
                port=self.port.name,
                state=State(self.state).name.lower(),
            )

    # Frames in sequence

    def submit(self, make: Callable[[int], bytes], segments: int = 0, seconds: float = 0.0) -> None:
        """Put a frame in line; make: its payload for a sequence number; segments: credit that it takes."""
        if not self._window:
            self._renew_patience()
        self._window.submit(make, segments, seconds)

    @property
    def backlog_and_credit(self) -> tuple[int, int]:
        """Frames that wait to be sent, and segments that the board's queue takes beyond all that were submitted."""
        return self._window.backlog, self._window.credit

    @property
    def under_way(self) -> float:
        """Seconds of motion that the board has not acknowledged."""
        return self._window.seconds

    def attend(self) -> None:
        """Reset the longest time [s] without reading, and the count of frames that the board has taken."""
        self.deaf, self.taken, self._turn = 0.0, 0, self.port.now()

    def flush(self) -> None:
        """Send all submitted frames, and wait until the board has executed or queued them."""
        while self._window:
            self.pump()

    def call(self, make: Callable[[int], bytes]) -> None:
        """Execute one frame. Raises DeviceError if the board refuses it."""
        self.submit(make)
        self.flush()

    def pump(self, timeout: float = 0.005, ends: bool = False) -> None:
        """One turn: send frames and process replies within `timeout`; ends: the queue ends, so poll often.

        Raises DeviceError when the session has ended, StoppedError after a stop, and LinkError when
        nothing answers.
        """
        if self._stop():
            raise StoppedError(self.hold())
        last_turn, time = self._turn, self.port.now()
        self._turn = time
        self._window.send()
        if time - self._last_request >= _between_questions(self.line, self._window, ends):
            self._ask()
        self._hear(timeout)
        self.deaf = max(self.deaf, time - last_turn, self.port.now() - time)
        if self._error is not None:
            if self._stop():  # a suspended program may find both an error and a stop request
                raise StoppedError(self.hold())
            raise DeviceError(self._error.error, self._error.detail, self._error.state)
        self._silent_for += min(self.port.now() - time, _MAX_TURN_WAIT)
        if self.heard >= time:
            self._silent_for = 0.0
        elif self._silent_for > _SILENCE_TIMEOUT:
            raise _silence_error(self.port)
        if self._window:
            self._check_stalled()

    def _ask(self, page: int = 0, copies: int = 1) -> int:
        self._last_request, self._tag = self.port.now(), (self._tag + 1) & 255
        self.line.note_status_request(self._tag)
        self.line.write(protocol.encode_frame(protocol.status_query(self._tag, page)) * copies)
        return self._tag

    def _hear(self, timeout: float) -> None:
        """Process the replies within timeout [s]. Raises LinkError for those of another session or board."""
        for reply in self.line.replies(timeout):
            self.heard = self.port.now()
            if isinstance(reply, Info):  # answer to a repeated HELLO
                reply_checks.check_session(reply.nonce & 0xFFFF, self._digest, self.port.name)
                continue
            assert self.info is not None
            reply_checks.check_reply(reply, self.info, self.port.name)
            if reply.error != Error.NO_SESSION:  # after a reset there is no session
                reply_checks.check_session(reply.session, self._digest, self.port.name)
                self._window.check(reply)
            goes_on, time_asked = reply.queued < self.queued or _has_moved(self.latest, reply), 0.0
            self.state, self.queued = State(reply.state), reply.queued
            self.last = reply
            if isinstance(reply, Status):
                self._status = reply
                self.latest = reply if reply.page == 0 else self.latest
                time_asked = self.line.take_answer(reply.tag)
            if (taken_frames := self._window.acknowledge(reply, time_asked)) or goes_on:
                self.taken += taken_frames
                self._renew_patience()
            if reply.error and self._error is None:
                self._error = reply

    # Questions, and stopping

    def status(self, page: int = 0) -> Status:
        """A fresh status of the board, also after the session has ended."""
        tags: list[int] = []  # tags of this call, as an answer may arrive after the next request
        begin = self.port.now()
        while self.port.now() - begin < _STATUS_TIMEOUT:
            tags.append(self._ask(page, self.line.copies))  # several copies, in case some are lost
            deadline = self.port.now() + self.line.patience
            while self.port.now() < deadline:
                self._status = None
                self._hear(max(0.001, deadline - self.port.now()))
                answer: Status | None = self._status
                if answer is not None and answer.tag in tags and answer.page == page:
                    # answers keep their order, so the earlier ones were lost
                    self.line.resent += tags.index(answer.tag)
                    return answer
        raise _silence_error(self.port)

    def hold(self) -> Status:
        """Stop the arm along its path; its status at rest."""
        self._window.clear()
        begin = self.port.now()
        while True:
            self._tag = (self._tag + 1) & 255
            self.port.write(b"\0" + protocol.encode_frame(protocol.hold(self._tag)))
            status = self.status()
            if status.state == State.IDLE and status.error:
                return status
            if self.port.now() - begin > _HOLD_TIMEOUT:
                raise LinkError(f"the board on {self.port.name} does not come to rest: cut the motors' power")
            self._hear(0.03)

    def wait_for_rest(self) -> Status:
        """Wait until the arm is at rest, in any session, and return its status."""
        self._until = self.port.now() + _HOLD_TIMEOUT
        while True:
            status = self.status()
            if status.state == State.IDLE:
                return status
            if self._stop():
                raise StoppedError(self.hold())
            self._check_stalled()
            self._hear(_QUICK_POLL_PERIOD)

    def arrivals(self, seconds: float = 0.0) -> Iterator[float]:
        """Wait until all submitted motion is done and the arm is at rest; yields the seconds left.

        seconds: duration of a motion that is not in the queue, such as homing.
        """
        self._until = max(self._until, self.port.now() + self.queued / 1000 + seconds + _STALL_TIMEOUT)
        while True:
            self._check_stalled()
            if not self._window and self.state == State.IDLE:
                return
            queue_left = self.queued - 1000 * (self.port.now() - self.heard)  # the queue empties between two replies
            self.pump(ends=not self._window and queue_left < _END_MILLISECONDS)
            yield self.under_way + self.queued / 1000


def _between_questions(line: Line, window: Window, ends: bool) -> float:
    """The time [s] between two status requests; ends: whether the queue ends soon."""
    if line.unanswered_count > _MAX_UNANSWERED:  # more requests would fill the line and be lost
        return _POLL_PERIOD
    # One request fits beside the frames; on a bad line the last one may be lost.
    is_late = window.late and (line.has_damage or not line.unanswered_count)
    normal = _NOISY_POLL_PERIOD if line.has_damage else _POLL_PERIOD
    period = _QUICK_POLL_PERIOD if ends or window.out_of_credit or is_late else normal
    return period / 2 if line.noisy else period


def probe_line(session: Session) -> None:
    """Send a few status requests to measure the quality of the line before a motion."""
    for _ in range(_PROBE_COUNT):
        if session.status().bad:
            session.line.resent += 1


def _new_nonce() -> int:
    """A new session's number. Its low half is the session's digest, and 0 means none."""
    return secrets.randbits(16) << 16 | 1 + secrets.randbelow(65535)


def _has_moved(last_status: Status | None, reply: Ack | Status) -> bool:
    """Whether the counts of a status differ from the last one."""
    return (
        isinstance(reply, Status) and last_status is not None and reply.page == 0 and reply.counts != last_status.counts
    )


def _silence_error(port: Port) -> LinkError:
    return LinkError(
        f"the board on {port.name} does not answer any more: is the cable plugged in?\n"
        "a moving arm has stopped on its path by itself; armkin status tells where it stands"
    )


def _no_board(port: Port, heard_bytes: bytes, has_damage: bool) -> LinkError:
    """The error of a port without a board that speaks this protocol.

    heard_bytes: received between two tries; has_damage: whether damaged frames were received.
    """
    port_text = f"{port.name} ({port.baud} baud)"
    if b"grbl" in heard_bytes.lower():
        text = f"GRBL answers on {port_text}: its robot file says board: {{kind: grbl}}"
    elif heard_bytes or has_damage:
        text = f"something answers on {port_text}, but not in this protocol: is armkin's firmware flashed?"
    else:
        text = f"no board answers on {port_text}: is armkin's firmware flashed?"
    return LinkError(f"{text}\n(armkin flash); armkin ports lists the other ports")
