"""The simulated board's homing: HOME of firmware/PROTOCOL.md, section 8, in simulated time."""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass

from armkin.board.firmware.wire.protocol import Error
from armkin.board.sim.cruise import Cruise

_DEBOUNCE_TIME = 0.004  # time [s] for which a switch must be closed


@dataclass(frozen=True)
class Search:
    """A HOME frame's fields."""

    switch: int
    closed: bool  # level of the pressed switch
    slow: float  # share of the rates
    backoff: int  # counts of the fastest axis
    travel: int  # counts of the fastest axis
    time: float  # [s]
    rate: list[int]


class Homing:
    """One search at a time, and the counts that the last one has latched."""

    def __init__(self, cruise: Cruise, level: Callable[[int], bool], fault: Callable[[Error], None]) -> None:
        self._cruise, self._level, self._fault = cruise, level, fault
        self.latch = [0] * len(cruise.axes.base)  # counts at the edge
        self.latched = False  # a search has finished
        self._switch_time = -1.0  # [s] when the switch reached the expected level; -1: not yet
        self._switch_counts: list[int] = []  # counts at that time
        self._beyond = 0  # counts past the edge at the rest after the first approach

    def run(self, search: Search) -> Iterator[None]:
        """Search for a switch; each item is a millisecond."""
        self.latched = False
        self._until = self._cruise.now + search.time
        return self._phases(search)

    def _phases(self, search: Search) -> Iterator[None]:
        """Leave the switch, find its edge fast, back off, find it slowly."""
        reverse = [-rate for rate in search.rate]
        if self._is_pressed(search) and not (
            yield from self._find_edge(search, reverse, search.slow, False, 2 * search.backoff, Error.SWITCH)
        ):
            return
        if not (yield from self._find_edge(search, search.rate, 1.0, True, search.travel, Error.TRAVEL)):
            return
        if not (yield from self._slide(reverse, 1.0, lambda: self._is_backed_off(search), 2**31, Error.SWITCH)):
            return
        if self._is_pressed(search):
            self._fault(Error.SWITCH)
        elif (yield from self._find_edge(search, search.rate, search.slow, True, 2 * search.backoff, Error.SWITCH)):
            self.latched = True

    def _find_edge(
        self, search: Search, vector: list[int], share: float, want_pressed: bool, limit: int, error: Error
    ) -> Generator[None, None, bool]:
        """Move until the switch is steadily pressed, or released."""
        self._switch_time = -1.0
        return self._slide(vector, share, lambda: self._is_steady(search, want_pressed), limit, error)

    def _slide(
        self, vector: list[int], share: float, finished: Callable[[], bool], limit: int, error: Error
    ) -> Generator[None, None, bool]:
        """Move until `finished`, then to rest; returns whether that succeeded."""
        cruise, in_limits = self._cruise, True
        cruise.aim(vector)
        while not cruise.stopped and not finished():
            if cruise.travel > limit or cruise.now > self._until:
                self._fault(Error.TIME if cruise.now > self._until else error)
                in_limits = False
                break
            cruise.glide(share)
            yield
        while cruise.share > 0:
            cruise.glide(0.0)
            yield
        if not in_limits or cruise.stopped:
            return False
        yield  # a millisecond at rest between two motions
        return True

    def _is_pressed(self, search: Search) -> bool:
        return self._level(search.switch) == search.closed

    def _is_steady(self, search: Search, want_pressed: bool) -> bool:
        """Whether the switch has had a level for long enough; latches the counts of the change."""
        present = self._cruise.now
        if self._is_pressed(search) != want_pressed:
            self._switch_time = -1.0
        elif self._switch_time < 0:
            self._switch_time, self._switch_counts = present, list(self._cruise.axes.base)
        is_steady = self._switch_time >= 0 and present - self._switch_time >= _DEBOUNCE_TIME
        if is_steady:
            self.latch = self._switch_counts
        return is_steady

    def _is_backed_off(self, search: Search) -> bool:
        """Whether braking now ends at the back-off distance."""
        leader = max(range(len(search.rate)), key=lambda i: abs(search.rate[i]))
        if self._cruise.travel == 0:
            self._beyond = abs(self._cruise.axes.base[leader] - self.latch[leader])
        return self._cruise.travel + self._cruise.braking_counts >= search.backoff + self._beyond
