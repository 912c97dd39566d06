"""A session with a board: opened, spoken in, held (firmware/PROTOCOL.md, section 3)."""

from __future__ import annotations

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
_NOISY_POLL_PERIOD = 0.025  # time [s] between two STATUS? on a bad line, which loses some of them
_QUICK_POLL_PERIOD = 0.01  # time [s] between two while waiting for credit, which only answers bring, or for the end
_END_MILLISECONDS = 50  # motion [ms] that the queue holds when its end is near
_SILENCE_TIMEOUT = 1.5  # time [s] without any answer after which a board counts as gone
_MAX_TURN_WAIT = 0.1  # time [s] that one turn counts at most: a program that waited longer for its own was deaf
_STATUS_TIMEOUT = 3.0  # time [s] of questions without an answer, of a board that was there
_MAX_UNANSWERED = 16  # questions without an answer
_STALL_TIMEOUT = 5.0  # time [s] beyond what all in the queue may take
_HOLD_TIMEOUT = 15.0  # time [s] that an arm may take to come to rest
_LISTEN_DELAY = 0.2  # time [s] after the opening by which a Mega's boot loader listens
_GREETING_TIME = 0.5  # time [s] in which a board that nothing has reset, or a Mega, answers
_BOOT_LOADER_TIME = 1.8  # time [s] after the opening by which every boot loader that nobody spoke to has left
_BOOT_TIMEOUT = 5.0  # time [s] that a board may take to answer after its port was opened
_MAX_JUNK_BYTES = 1000  # bytes of what is no board's that are kept
_PROBE_COUNT = 8  # questions that a line is judged by


class Session:
    """Conversation with the board behind a port; `stop` is asked all the time, and leads to a hold."""

    def __init__(self, port: Port, stop: Callable[[], bool] = lambda: False) -> None:
        self.port = port
        self.info: Info | None = None
        self.state = State.IDLE
        self.queued = 0  # [ms] as last heard
        self.latest: Status | None = None  # as last heard
        self.line = Line(port)
        self._window = Window(self.line)
        self._stop = stop
        self._tag = 0
        self._digest = 0
        self._status: Status | None = None
        self.last: Ack | Status | None = None  # as last heard
        self._error: Ack | Status | None = None
        self.attend()
        self.heard, self._silent_for = self._turn, 0.0  # [s] in which an answer would have been heard
        self._last_request = 0.0
        self._until = 0.0  # something has to go on by then

    # Opening

    def open(self) -> Info:
        """Open a session, waiting for a board that its opened port has reset.

        Raises LinkError if nothing answers, or something else than this protocol.
        """
        begin, nonce = self.port.now(), _new_nonce()
        heard, leave = bytearray(), [_LISTEN_DELAY, _BOOT_LOADER_TIME]
        while True:
            since = self.port.now() - begin
            # A few tries; then silence, for a boot loader that listens; then on to the end.
            if leave and since > leave[0]:
                leave_boot_loader(self.port)
                del leave[0]
                nonce = _new_nonce()  # a new session: a board counts those words as damaged frames
            if since < _GREETING_TIME or since > _BOOT_LOADER_TIME:
                late_patience = 0.15 if since < 3.0 else 0.4
                info = self._greet(nonce, 0.06 if since < _GREETING_TIME else late_patience)
                if info is not None:
                    return info
            else:
                heard += self.port.read(0.05)[: _MAX_JUNK_BYTES - len(heard)]
            if self._stop():
                raise StoppedError
            if since > _BOOT_TIMEOUT:
                raise _no_board(self.port, bytes(heard), self.line.splitter.bad > 0)

    def reopen(self) -> Info:
        """Open a new session on a board that is there: what stopped the last one is over."""
        for _ in range(8):
            nonce = _new_nonce()  # an answer to any of these will do: a busy computer's come late
            for patience in (self.line.patience,) * 8 + (0.2,):
                info = self._greet(nonce, patience)
                if info is not None:
                    return info
        raise _silence_error(self.port)

    def _greet(self, nonce: int, timeout: float) -> Info | None:
        """Greet the board. A repeated nonce changes nothing there: the answer to the one before serves as well."""
        self._tag = (self._tag + 1) & 255
        self.port.write(b"\0" + protocol.encode_frame(protocol.hello(self._tag, nonce)) * self.line.copies)
        end = self.port.now() + timeout
        while self.port.now() < end:
            for payload in self.line.splitter.feed(self.port.read(max(0.001, end - self.port.now()))):
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
        """Something went on: wait for the next as long as what is queued may take, and a little."""
        self._until = self.port.now() + self.queued / 1000 + _STALL_TIMEOUT

    def _check_stalled(self) -> None:
        """Raise LinkError if the board has neither gone on nor come to rest in all the time that it may take."""
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
    def pending(self) -> tuple[int, int]:
        """Frames that wait to be sent, and segments that the board's queue takes beyond all that were submitted."""
        return self._window.backlog, self._window.credit

    @property
    def under_way(self) -> float:
        """Seconds of motion that the board has not acknowledged."""
        return self._window.seconds

    def attend(self) -> None:
        """Begin to measure the longest time [s] that this program is deaf, and to count frames that the board takes."""
        self.deaf, self.taken, self._turn = 0.0, 0, self.port.now()

    def flush(self) -> None:
        """Send what is in line, and wait until the board has executed or queued all of it."""
        while self._window:
            self.pump()

    def call(self, make: Callable[[int], bytes]) -> None:
        """Execute one frame. Raises DeviceError if the board refuses it."""
        self.submit(make)
        self.flush()

    def pump(self, timeout: float = 0.005, ends: bool = False) -> None:
        """One turn: send what may be sent, hear what has come within `timeout`; ends: the queue does, so ask soon.

        Raises DeviceError when the session has ended, StoppedError after a stop, and LinkError when
        nothing answers.
        """
        if self._stop():
            raise StoppedError(self.hold())
        before, present = self._turn, self.port.now()
        self._turn = present
        self._window.send()
        if present - self._last_request >= _between_questions(self.line, self._window, ends):
            self._ask()
        self._hear(timeout)
        self.deaf = max(self.deaf, present - before, self.port.now() - present)
        if self._error is not None:
            if self._stop():  # a suspended sender wakes to both: the board's silence, and the wish that it stop
                raise StoppedError(self.hold())
            raise DeviceError(self._error.error, self._error.detail, self._error.state)
        self._silent_for += min(self.port.now() - present, _MAX_TURN_WAIT)
        if self.heard >= present:
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
        """Take the replies that come within timeout [s]; LinkError for those of another session or board."""
        for reply in self.line.replies(timeout):
            self.heard = self.port.now()
            if isinstance(reply, Info):  # a repeated HELLO has this answer
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
            if (taken := self._window.acknowledge(reply, time_asked)) or goes_on:
                self.taken += taken
                self._renew_patience()
            if reply.error and self._error is None:
                self._error = reply

    # Questions, and stopping

    def status(self, page: int = 0) -> Status:
        """Where the board stands, now; also after the session has ended."""
        tags: list[int] = []  # asked since this was called: an answer may come later than the next question
        begin = self.port.now()
        while self.port.now() - begin < _STATUS_TIMEOUT:
            tags.append(self._ask(page, self.line.copies))  # each is answered: one of them will come through
            end = self.port.now() + self.line.patience
            while self.port.now() < end:
                self._status = None
                self._hear(max(0.001, end - self.port.now()))
                answer: Status | None = self._status
                if answer is not None and answer.tag in tags and answer.page == page:
                    self.line.resent += tags.index(answer.tag)  # answers keep order: those before were lost
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
        """Wait until the arm stands, whatever the session is; its status then."""
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
        """Wait until all that was submitted is done and the arm stands; yields the seconds left.

        seconds: that a motion may take which is not queued: homing.
        """
        self._until = max(self._until, self.port.now() + self.queued / 1000 + seconds + _STALL_TIMEOUT)
        while True:
            self._check_stalled()
            if not self._window and self.state == State.IDLE:
                return
            left = self.queued - 1000 * (self.port.now() - self.heard)  # what is queued goes on unheard
            self.pump(ends=not self._window and left < _END_MILLISECONDS)
            yield self.under_way + self.queued / 1000


def _between_questions(line: Line, window: Window, ends: bool) -> float:
    """Seconds from one question for the status to the next; ends: the queue does."""
    if line.unanswered > _MAX_UNANSWERED:  # more questions would fill the line, and be lost in front of the board
        return _POLL_PERIOD
    # There is room for one question beside the frames; on a bad line the one before may be lost.
    late = window.late and (line.damaged or not line.unanswered)
    often = _NOISY_POLL_PERIOD if line.damaged else _POLL_PERIOD
    quick = _QUICK_POLL_PERIOD if ends or window.out_of_credit or late else often
    return quick / 2 if line.noisy else quick


def probe_line(session: Session) -> None:
    """Ask a few questions, to learn whether the line is good before anything depends on it."""
    for _ in range(_PROBE_COUNT):
        if session.status().bad:
            session.line.resent += 1


def _new_nonce() -> int:
    """A new session's number. Its low half is the session's digest, and 0 means none."""
    return secrets.randbits(16) << 16 | 1 + secrets.randbelow(65535)


def _has_moved(last_status: Status | None, reply: Ack | Status) -> bool:
    """Whether a status tells other counts than the one before."""
    return (
        isinstance(reply, Status) and last_status is not None and reply.page == 0 and reply.counts != last_status.counts
    )


def _silence_error(port: Port) -> LinkError:
    return LinkError(
        f"the board on {port.name} does not answer any more: is the cable plugged in?\n"
        "a moving arm has stopped on its path by itself; armkin status tells where it stands"
    )


def _no_board(port: Port, heard: bytes, damaged: bool) -> LinkError:
    """What to say of a port where this protocol is not spoken.

    heard: what came between two tries; damaged: whether something came that is no frame of the protocol.
    """
    port_text = f"{port.name} ({port.baud} baud)"
    if b"grbl" in heard.lower():
        why = f"GRBL answers on {port_text}: its robot file says board: {{kind: grbl}}"
    elif heard or damaged:
        why = f"something answers on {port_text}, but not in this protocol: is armkin's firmware flashed?"
    else:
        why = f"no board answers on {port_text}: is armkin's firmware flashed?"
    return LinkError(f"{why}\n(armkin flash); armkin ports lists the other ports")
