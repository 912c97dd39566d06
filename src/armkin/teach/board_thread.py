"""The board behind the page: one thread owns the port, carries out one job at a time, and always obeys STOP.

Jobs never start by themselves and are not queued: a request while the arm moves is refused. STOP is no job. The session
checks for it at every turn, 200 times a second, and holds the arm.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from armkin.board.backend import Backend, StoppedError
from armkin.board.kinds import board_of
from armkin.board.ports import SIM
from armkin.board.sim.sim_port import Paced
from armkin.errors import ArmkinError, LinkError
from armkin.model import units
from armkin.motors import joints as joints_of
from armkin.teach.page_key import RefusedError

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

Job = Callable[[Backend], None]

_POLL_PERIOD = 0.25  # time [s] between two status requests at rest
_TELL_PERIOD = 0.08  # time [s] between two positions during motion, as fast as a page draws


class BoardThread:
    """The thread that owns the port of an arm's board, and calls `publish` with its state on every change."""

    def __init__(self, arm: Arm, port: str, baud: int | None, publish: Callable[[dict[str, Any]], None]) -> None:
        """Raises UsageError if the robot file lacks keys for the board."""
        self.arm, self.port = arm, port
        self.baud, self.publish = baud, publish
        self.board = board_of(arm, rehearsal=port == SIM)
        self.link: Port | None = None
        self.machine: Backend | None = None
        self.progress = (0.0, 0.0)  # seconds done of the job's motion, and in all
        self.progress_seconds = 0.0  # seconds done, not rounded
        self.parts: list[Trajectory] = []  # trajectories of the motion in order; empty without a plan
        self.follower = ""  # id of the page that the arm follows; empty: none
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._stop = threading.Event()
        self._ended = False
        self._let_go: Callable[[], bool] = lambda: False  # whether the held button was released
        self._job: tuple[str, Job] | None = ("connect", lambda machine: None)
        self._doing = "connect"  # name of the job, "" if there is none
        self._error = ""
        self._ended_jobs = (0, "")  # number of ended jobs and name of the last, as a page may miss a short job
        self._published: dict[str, Any] = {}
        self._told_at = 0.0
        self._telling = threading.Lock()
        self._thread = threading.Thread(target=self._run_jobs, name="board")
        self._thread.start()

    # Methods for the threads of pages

    def submit(self, name: str, job: Job) -> None:
        """Start a job at once. Raises RefusedError while another one runs."""
        with self._lock:
            if self._doing or self._stop.is_set():
                raise RefusedError(409, f"the arm is busy ({self._doing or 'stop'}): wait for it, or STOP")
            self._job, self._doing = (name, job), name
            self._error, self.progress = "", (0.0, 0.0)
            self.parts, self.progress_seconds = [], 0.0
        self._wake.set()

    def stop(self) -> None:
        """Stop the arm along its path; returns at once."""
        self._stop.set()
        self._wake.set()

    def set_follower(self, tab: str) -> None:
        """Set the page that the arm follows, or none, and publish it."""
        with self._telling:
            last_follower, self.follower = self.follower, tab
            if tab != last_follower and self._published:
                self._published = {**self._published, "follows": bool(tab)}
                self.publish(self._published)

    def abandoned(self) -> None:
        """Stop the motion of a page in control that was closed."""
        if self._doing not in ("", "connect"):
            self.stop()

    def close(self) -> None:
        """Stop the arm, and close the port."""
        self._ended = True
        if self._doing:
            self._stop.set()
        self._wake.set()
        self._thread.join(20)

    @property
    def doing(self) -> str:
        """Name of the running job; empty if there is none and the end of the last one was published."""
        return self._doing or str(self._published.get("doing", ""))

    @property
    def stopping(self) -> bool:
        """Whether a STOP is in progress."""
        return self._stop.is_set()

    def state(self) -> dict[str, Any]:
        """The published state, as JSON."""
        return self._published or self._state_json()

    def standing_pulses(self) -> tuple[int, ...] | None:
        """Pulses of the arm's position; None if unknown."""
        counts = self.state()["pulses"]
        return None if counts is None else tuple(counts)

    # The thread that owns the port

    def _run_jobs(self) -> None:
        """The thread's loop: stop, carry out the job that waits, else read the board; closes the link at the end."""
        while not self._ended:
            self._wake.wait(_POLL_PERIOD)
            self._wake.clear()
            with self._lock:
                job, self._job = self._job, None
            if self._stop.is_set():
                self._hold()
            elif job is not None:
                self._carry_out(*job)
            elif self.machine is not None:
                self._poll(self.machine)
        if self.link is not None:
            self.link.close()

    def _carry_out(self, name: str, job: Job) -> None:
        """Run one job on the board, and publish its start and its end or error."""
        self._doing = name
        self._publish()
        try:
            machine = self._open()
            job(machine)
        except StoppedError as error:
            self._note_stop(error)
        except ArmkinError as error:
            self._error = error.message
            if self.machine is None or not self._board_answers(self.machine):
                self._disconnect()
        except Exception as error:
            # The arm must not move on after an unexpected error.
            self._error = f"internal error: {error!r}: this is a bug in armkin"
            self._stop.set()
            self._wake.set()
        self._doing, self._ended_jobs = "", (self._ended_jobs[0] + 1, name)
        self._publish()

    def _open(self) -> Backend:
        """The machine, connected at first and with a new job begun later."""
        is_first = self.machine is None
        if self.link is None:
            port = self.board.open(self.port, self.baud)
            self.link = Paced(port) if port.simulated else port
        if self.machine is None:
            self.machine = self.board.connect(self.link, self._watch)
        else:
            self.board.begin_job()
            self.machine = self.board.machine
        if is_first and self.link.simulated:
            self.machine.prepare()  # the arm on a simulated board starts at home
        return self.machine

    def _watch(self) -> bool:
        """Called at every turn of a session: publish the position, and return whether to stop."""
        if self.machine is not None and time.monotonic() - self._told_at >= _TELL_PERIOD:
            self.board.on_report()
            self._publish()
        return self._stop.is_set() or self._let_go()

    @contextmanager
    def held_motion(self, let_go: Callable[[], bool]) -> Iterator[None]:
        """Run a motion that is held on its path, without an error, when `let_go` returns True."""
        self._let_go = let_go
        try:
            yield
        except StoppedError as error:
            if self._stop.is_set():
                raise
            self.board.on_stopped(error)
        finally:
            self._let_go = lambda: False

    def _hold(self) -> None:
        """Hold the board after a STOP without a running job."""
        with self._lock:
            self._job, self._doing = None, ""
        if self.machine is not None:
            try:
                self.machine.hold()
            except LinkError as error:
                self._error = error.message
                self._disconnect()
        self._publish()
        self._stop.clear()

    def _note_stop(self, error: StoppedError) -> None:
        if self.machine is not None:
            self.board.on_stopped(error)
        self._error = "stopped"
        self._stop.clear()

    def _poll(self, machine: Backend) -> None:
        try:
            machine.refresh()
        except LinkError as error:
            self._error = error.message
            self._disconnect()
        self._publish()

    def _board_answers(self, machine: Backend) -> bool:
        try:
            machine.refresh()
        except LinkError:
            return False
        return True

    def _disconnect(self) -> None:
        if self.link is not None:
            self.link.close()
        self.link = self.machine = None
        self.set_follower("")

    def _state_json(self) -> dict[str, Any]:
        """The state for the pages: board, times [s], and the arm's position [counts, deg | mm]."""
        machine = self.machine
        state: dict[str, Any] = {
            "port": self.port,
            "board": self.board.kind,
            "simulated": self.port == SIM,
            "connected": machine is not None,
            "doing": self._doing,
            "follows": bool(self.follower),
            "ended": {"count": self._ended_jobs[0], "name": self._ended_jobs[1]},
            "done_s": self.progress[0],
            "total_s": self.progress[1],
            "position": "unknown" if machine is None else machine.position(),
            "pulses": None,
            "joints": None,
            "commanded": self._planned_joints(),
            "error": self._error,
            "differences": [] if machine is None else list(machine.differences),
        }
        if machine is not None and state["position"] in ("known", "retained"):
            counts = machine.counts()
            state["pulses"] = list(counts)
            state["joints"] = units.joints_out(self.arm, joints_of(self.arm, counts)).tolist()
        return state

    def _planned_joints(self) -> list[float] | None:
        """Joint values of the plan at this moment [deg | mm]; None without a planned motion."""
        seconds = self.progress_seconds
        for part in self.parts if self._doing else ():
            if seconds <= part.duration or part is self.parts[-1]:
                return [float(x) for x in units.joints_out(self.arm, part.q(min(seconds, part.duration)))]
            seconds -= part.duration
        return None

    def _publish(self) -> None:
        with self._telling:
            state = self._state_json()
            if state != self._published:
                self._published, self._told_at = state, time.monotonic()
                self.publish(state)
