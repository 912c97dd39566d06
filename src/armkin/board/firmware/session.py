"""A session with a board: go-back-N with credit, over any port (firmware/PROTOCOL.md, section 3).

What is submitted is sent in order, kept until it is acknowledged, and sent again when it is not. A frame is
executed once or not at all, however often it is sent.
"""

from __future__ import annotations

import secrets
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from armkin.board.backend import StoppedError
from armkin.board.firmware import heed, protocol
from armkin.board.firmware.heed import DeviceError as DeviceError
from armkin.board.firmware.heed import ReplacedError as ReplacedError
from armkin.board.firmware.protocol import Ack, Error, Info, State, Status
from armkin.board.ports import Port
from armkin.errors import LinkError

_RESEND = 0.03  # [s] without progress
_GAP = 0.004  # [s] after all was sent, before an ACK of a gap leads to sending it again
_POLL = 0.1  # [s] between STATUS?: the board holds after 0.5 s of silence
_POLL_NOISY = 0.025  # [s] the same on a bad line, which loses some of them
_POLL_CREDIT = 0.01  # [s] while waiting for credit, which only answers bring
_GIVE_UP = 1.5  # [s] without any answer
_STALLED = 5.0  # [s] beyond the time that all in the queue may take
_HOLD = 15.0  # [s] that an arm may take to come to rest
_BOOT = 5.0  # [s] that a board may take to answer after its port was opened
_COPIES = 3  # of every frame, on a bad line
_EAGER = 0.002  # [s] without progress, on a bad line: nothing is gained by waiting for what was damaged
_LATE = 0.03  # [s] an answer may take
_PROBES = 8
_UNDER_WAY = 16  # frames
_BYTES = (240, 700)  # under way, on a bad line and on a good one
_QUESTION = 12  # [bytes] of a STATUS? on the line


@dataclass
class _Frame:
    make: Callable[[int], bytes]
    segments: int
    seconds: float  # of motion


class Session:
    """Conversation with the board behind a port; `stop` is asked all the time, and leads to a hold."""

    def __init__(self, port: Port, stop: Callable[[], bool] = lambda: False) -> None:
        self.port = port
        self.info: Info | None = None
        self.state = State.IDLE
        self.queued = 0  # [ms] as last heard
        self.resent = 0  # frames
        self._stop = stop
        self._splitter = protocol.Splitter()
        self._waiting: deque[_Frame] = deque()  # not sent yet
        self._sent: deque[tuple[_Frame, bytes]] = deque()  # not acknowledged yet
        self._next = 0  # sequence number of the first of them
        self._free = 0
        self._queue = 0
        self._tag = 0
        self._digest = 0
        self._asked_at: dict[int, float] = {}  # tag -> when its STATUS? was written
        self.latest: Status | None = None  # as last heard
        self._status: Status | None = None
        self._error: Ack | Status | None = None
        self._heard = port.now()
        self._asked = 0.0
        self._clear = 0.0  # when all that was written will have left, and the window last moved
        self._gap = False
        self._until = 0.0  # something has to go on by then
        self._bytes = _BYTES[1]  # that may be under way
        self._written = 0  # frames in sequence

    # Opening

    def open(self) -> Info:
        """Open a session, waiting for a board that its opened port has reset.

        Raises LinkError if nothing answers, or something else than this protocol.
        """
        begin, quiet = self.port.now(), True
        while True:
            since = self.port.now() - begin
            # A few tries; then silence, for a boot loader that listens; then on to the end.
            if since < 0.3 or since > 1.8:
                info = self._hello(0.06 if since < 0.3 else 0.15)
                if info is not None:
                    return info
            else:
                quiet = not self.port.read(0.05) and quiet
            if self._stop():
                raise StoppedError
            if since > _BOOT:
                heard = "nothing" if quiet and not self._splitter.bad else "but not in this protocol"
                raise LinkError(
                    f"no board answers on {self.port.name} ({heard}; {self.port.baud} baud): is armkin's "
                    "firmware flashed?\n(make -C firmware flash PORT=...); armkin ports lists the other ports"
                )

    def reopen(self) -> Info:
        """Open a new session on a board that is there: what stopped the last one is over."""
        for _ in range(40):
            info = self._hello(0.05)
            if info is not None:
                return info
        raise self._silent()

    def _hello(self, timeout: float) -> Info | None:
        # the low half is the session's digest, and 0 means none
        nonce, self._tag = secrets.randbits(16) << 16 | 1 + secrets.randbelow(65535), (self._tag + 1) & 255
        self.port.write(b"\0" + protocol.wire(protocol.hello(self._tag, nonce)))
        end = self.port.now() + timeout
        while self.port.now() < end:
            for payload in self._splitter.feed(self.port.read(max(0.001, end - self.port.now()))):
                version = protocol.info_version(payload)
                if version is not None and version != protocol.VERSION:
                    raise heed.other_version(self.port.name, version)
                info = protocol.parse(payload)
                if isinstance(info, Info) and info.nonce == nonce:
                    self._begin(info)
                    return info
        return None

    def _begin(self, info: Info) -> None:
        heed.check_info(info, self.port.name)
        self.info = info
        self._digest = info.nonce & 0xFFFF
        self._waiting.clear()
        self._sent.clear()
        self._next, self._free, self._queue = 0, info.queue, info.queue
        self._error, self._gap = None, False
        self._heard = self.port.now()
        self._patient()

    def _patient(self) -> None:
        """Something went on: wait for the next as long as what is queued may take, and a little."""
        self._until = self.port.now() + self.queued / 1000 + _STALLED

    def _stalled(self) -> None:
        """Raise LinkError if the board has neither gone on nor come to rest in all the time that it may take."""
        if self.port.now() > self._until:
            raise LinkError(
                f"the board on {self.port.name} answers, but does not go on: it stays {State(self.state).name}\n"
                "if the arm moves, cut the motors' power; armkin status tells what the board says",
                port=self.port.name,
                state=State(self.state).name.lower(),
            )

    # Frames in sequence

    def submit(self, make: Callable[[int], bytes], segments: int = 0, seconds: float = 0.0) -> None:
        """Put a frame in line; make: its payload for a sequence number; segments: credit that it takes."""
        if not (self._waiting or self._sent):
            self._patient()
        self._waiting.append(_Frame(make, segments, seconds))

    @property
    def backlog(self) -> int:
        """Frames that wait to be sent."""
        return len(self._waiting)

    @property
    def under_way(self) -> float:
        """Seconds of motion that the board has not acknowledged."""
        return sum(f.seconds for f in self._waiting) + sum(f.seconds for f, _ in self._sent)

    def flush(self) -> None:
        """Send what is in line, and wait until the board has executed or queued all of it."""
        while self._waiting or self._sent:
            self.pump()

    def call(self, make: Callable[[int], bytes]) -> None:
        """Execute one frame. Raises DeviceError if the board refuses it."""
        self.submit(make)
        self.flush()

    def pump(self, timeout: float = 0.005) -> None:
        """One turn: send what may be sent, hear what has come within `timeout`.

        Raises DeviceError when the session has ended, StoppedError after a stop, and LinkError when
        nothing answers.
        """
        if self._stop():
            raise StoppedError(self.hold())
        now = self.port.now()
        self._fill()
        if self._sent and now - self._clear > (_EAGER if self.noisy else _GAP if self._gap else _RESEND):
            self._again()
        idle_credit = bool(self._waiting) and not self._sent
        if now - self._asked >= (_POLL_CREDIT if idle_credit else _POLL_NOISY if self.damaged else _POLL):
            self._ask()
        self._hear(timeout)
        if self._error is not None:
            raise DeviceError(self._error.error, self._error.detail, self._error.state)
        if self.port.now() - self._heard > _GIVE_UP:
            raise self._silent()
        if self._waiting or self._sent:
            self._stalled()

    @property
    def noisy(self) -> bool:
        """Whether the line damages so much that short frames, sent several times, get through sooner."""
        damaged = self._splitter.bad + self.resent
        return damaged > max(2.0, 0.03 * self._written)

    @property
    def damaged(self) -> bool:
        """Whether anything at all was damaged or lost so far."""
        return self._splitter.bad + self.resent > 0

    def probe(self) -> None:
        """Ask a few questions, to learn whether the line is good before anything depends on it."""
        for _ in range(_PROBES):
            if self.status().bad:
                self.resent += 1

    def _write(self, data: bytes) -> None:
        self.port.write(data)
        self._clear = max(self._clear, self.port.now()) + len(data) * 10 / self.port.baud

    def _write_frame(self, data: bytes, room: int) -> int:
        """Write a frame, on a bad line as often as `room` bytes allow; the bytes written."""
        self._written += 1
        copies = max(1, min(_COPIES, room // len(data))) if self.noisy else 1
        self._write(data * copies)  # a copy too many moves nothing
        return copies * len(data)

    def _room(self, size: int, first: int) -> int:
        """Bytes that may be sent when `size` are under way, of which the first frame has `first`.

        What follows the frame that the board is busy with must fit into its receive buffer, a STATUS? included.
        """
        assert self.info is not None
        return min(self._bytes, first + self.info.receive - _QUESTION) - size

    def _fill(self) -> None:
        """Send new frames as far as credit and window allow."""
        credit = self._free - sum(frame.segments for frame, _ in self._sent)
        size = sum(len(data) for _, data in self._sent)
        while self._waiting and len(self._sent) < _UNDER_WAY:
            if self._waiting[0].segments > credit:
                return
            data = protocol.wire(self._waiting[0].make((self._next + len(self._sent)) & 255))
            first = len(self._sent[0][1]) if self._sent else len(data)
            room = self._room(size, first)
            if self._sent and len(data) > room:
                return
            frame = self._waiting.popleft()
            self._sent.append((frame, data))
            credit -= frame.segments
            size += self._write_frame(data, room)

    def _again(self) -> None:
        """Go back to the first frame that was not acknowledged."""
        self._gap = False
        self._bytes = _BYTES[0] if self.noisy else max(_BYTES[0], self._bytes // 2)
        self._write(b"\0")
        size, first = 0, len(self._sent[0][1])
        for _, data in self._sent:
            room = self._room(size, first)
            if size and len(data) > room:
                break  # what follows it would wait for it
            self.resent += 1
            size += self._write_frame(data, room)

    def _ask(self, page: int = 0) -> int:
        self._asked, self._tag = self.port.now(), (self._tag + 1) & 255
        self._asked_at[self._tag] = self._asked
        self._write(protocol.wire(protocol.status_query(self._tag, page)))
        return self._tag

    def _hear(self, timeout: float) -> None:
        for payload in self._splitter.feed(self.port.read(timeout)):
            reply = protocol.parse(payload)
            if reply is None:
                continue
            self._heard = self.port.now()
            if isinstance(reply, Info):
                self._same(reply.nonce & 0xFFFF)
                continue  # of a HELLO that was repeated
            assert self.info is not None
            heed.check_reply(reply, self.info, self.port.name)
            if reply.error != Error.NO_SESSION:  # after a reset there is no session
                self._same(reply.session)
                heed.check_next((reply.next - self._next) & 255, len(self._sent), self.port.name)
            self.state, self.queued = State(reply.state), reply.queued
            if isinstance(reply, Status):
                self._status = reply
                self.latest = reply if reply.page == 0 else self.latest
                self._measure(reply.tag)
            self._acknowledge(reply)

    def _same(self, digest: int) -> None:
        """Raise ReplacedError if a reply belongs to another session than this one."""
        if digest != self._digest:
            raise ReplacedError(
                f"another program has taken over the board on {self.port.name}: this one has ended\n"
                "only one program may move an arm; armkin status tells where it stands",
                port=self.port.name,
            )

    def _measure(self, tag: int) -> None:
        """Wait as long as an answer was late: so long the line is behind what was written already."""
        asked = self._asked_at.pop(tag, None)
        if asked is not None:
            self._asked_at = {t: at for t, at in self._asked_at.items() if at > asked}
            late = self.port.now() - asked - _LATE
            if late > 0:
                self._clear = max(self._clear, self.port.now() + late)

    def _acknowledge(self, reply: Ack | Status) -> None:
        done = (reply.next - self._next) & 255
        if done <= len(self._sent):
            for _ in range(done):
                self._sent.popleft()
            self._next = reply.next
            self._free = reply.free
            if done:
                self._patient()
                self._clear, self._gap = max(self._clear, self.port.now()), False
                self._bytes = _BYTES[0] if self.noisy else min(_BYTES[1], self._bytes + 20)
            elif self._sent and (type(reply) is Ack or (reply.detail == Error.SPILL and not reply.error)):
                self._gap = True  # something behind the first frame has arrived, the first has not
        if reply.error and self._error is None:
            self._error = reply

    # Questions, and stopping

    def status(self, page: int = 0) -> Status:
        """Where the board stands, now; also after the session has ended."""
        for attempt in range(60):
            self.resent += attempt > 0
            tag, end = self._ask(page), self.port.now() + 0.05
            while self.port.now() < end:
                self._status = None
                self._hear(max(0.001, end - self.port.now()))
                answer: Status | None = self._status
                if answer is not None and answer.tag == tag and answer.page == page:
                    return answer
        raise self._silent()

    def hold(self) -> Status:
        """Stop the arm along its path; its status at rest."""
        self._waiting.clear()
        begin = self.port.now()
        while True:
            self._tag = (self._tag + 1) & 255
            self.port.write(b"\0" + protocol.wire(protocol.hold(self._tag)))
            status = self.status()
            if status.state == State.IDLE and status.error:
                return status
            if self.port.now() - begin > _HOLD:
                raise LinkError(f"the board on {self.port.name} does not come to rest: cut the motors' power")
            self._hear(0.03)

    def rest(self) -> Status:
        """Wait until the arm stands, whatever the session is; its status then."""
        self._until = self.port.now() + _HOLD
        while True:
            status = self.status()
            if status.state == State.IDLE:
                return status
            if self._stop():
                raise StoppedError(self.hold())
            self._stalled()
            self._hear(0.02)

    def arrivals(self, seconds: float = 0.0) -> Iterator[float]:
        """Wait until all that was submitted is done and the arm stands; yields the seconds left.

        seconds: that a motion may take which is not queued: homing.
        """
        self._until = max(self._until, self.port.now() + self.queued / 1000 + seconds + _STALLED)
        while True:
            self._stalled()
            if not (self._waiting or self._sent) and self.state == State.IDLE:
                return
            # Asking again when the queue must have ended, rather than at the next poll.
            if not (self._waiting or self._sent) and self.queued < 50:
                self._asked = min(self._asked, self.port.now() - _POLL + 0.01)
            self.pump()
            yield self.under_way + self.queued / 1000

    def _silent(self) -> LinkError:
        return LinkError(
            f"the board on {self.port.name} does not answer any more: is the cable plugged in?\n"
            "a moving arm has stopped on its path by itself; armkin status tells where it stands"
        )
