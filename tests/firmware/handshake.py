"""A model of what tick interrupt and main loop share: queue_tail, queue_head, left, now, settled, stretch, prepared.

Every step is one access that an interrupt may come before or after. `explore_states` visits every state that any
interleaving reaches, and returns the first promise that one of them breaks. The words are those of motion.c and dda.h.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

SLOTS = 2  # the indices run freely modulo 2 * SLOTS, as 8 bits do over 128 slots at most
MOST = 4  # segments that are ever queued
TICKS = (1, 2)  # of a segment
NONE = 0  # dda.now at rest


@dataclass(frozen=True)
class State:
    """All of the board that matters, and in `ghost` names what the model alone knows."""

    head: int = 0
    tail: int = 0
    settled: int = 0
    slots: tuple[int, ...] = (0,) * SLOTS  # ticks of each segment
    now: int = NONE  # slot + 1
    left: int = 0
    rates: int = 0  # dda.rate: whose they are, told by its ticks
    prepared: bool = False  # they are the next segment's
    fed: bool = False  # the timer has a tick to put out
    pending: bool = False  # an edge is out whose interrupt has not run
    locked: bool = False
    counts: int = 0  # memory.counts: ticks of settled segments
    stretch: tuple[int, int] = (1, 0)  # bytes; 256 at rest, 513 in a hold
    call: str = ""  # what the main loop is doing
    at: int = 0  # its next step
    seen: tuple[int, ...] = ()  # its local variables
    ghost_edges: int = 0
    ghost_queued: int = 0  # segments so far
    ghost_due: int = 0  # ticks queued and not dropped


class BrokenError(Exception):
    """A promise is broken."""


def check_promise(is_kept: bool, law: str) -> None:
    if not is_kept:
        raise BrokenError(law)


def load_segment(s: State) -> State:
    if s.tail == s.head:
        return replace(s, now=NONE, fed=False)
    slot = s.tail % SLOTS
    check_promise(s.slots[slot] > 0, "the interrupt takes up a segment that is not written")
    rates = s.rates if s.prepared else s.slots[slot]
    return replace(s, now=slot + 1, left=s.slots[slot], fed=True, rates=rates, prepared=False)


def prepare_short_tick(s: State) -> State:
    """The short tick, behind the steps of a segment's last one: the next one's rates, if it is there."""
    after = (s.tail + 1) % (2 * SLOTS)
    if s.now == NONE or s.left or after == s.head:
        return s
    check_promise(s.slots[after % SLOTS] > 0, "the interrupt takes the rates of a segment that is not written")
    return replace(s, rates=s.slots[after % SLOTS], prepared=True)


def interrupt(s: State) -> State:
    """What follows an edge: dda_next()."""
    s = replace(s, pending=False)
    if s.left == 0:
        s = load_segment(replace(s, tail=(s.tail + 1) % (2 * SLOTS)))
        if s.now == NONE:
            return s
    check_promise(s.stretch in ((1, 0), (2, 1)), "the interrupt reads half of a stretch")
    check_promise(s.rates == s.slots[s.now - 1], "a segment moves by another one's rates")
    return replace(s, left=s.left - 1, fed=True)


def settle_to(s: State, tail: int) -> State:
    while s.settled != tail:
        slot = s.settled % SLOTS
        check_promise(s.slots[slot] > 0, "a segment is counted that is not there")
        s = replace(s, counts=s.counts + s.slots[slot], settled=(s.settled + 1) % (2 * SLOTS))
    return s


def free_slots(s: State) -> int:
    return SLOTS - (s.head - s.settled) % (2 * SLOTS)


def ticks_out(s: State, running: int, left: int) -> int:
    """motion_counts(): ticks that are out."""
    return s.counts + (s.slots[running - 1] - left - 1 if running else 0)


# The main loop's calls, step by step; a step returns the next state, and None ends the call.

Step = Callable[[State], State | None]


def lock_interrupts(s: State) -> State:
    return replace(s, locked=True)


def unlock_interrupts(s: State) -> State:
    return replace(s, locked=False)


def write_segment(ticks: int) -> Step:
    def step(s: State) -> State | None:
        if not free_slots(s) or s.ghost_queued == MOST:
            return None
        slots = tuple(ticks if i == s.head % SLOTS else t for i, t in enumerate(s.slots))
        return replace(s, slots=slots, ghost_queued=s.ghost_queued + 1, ghost_due=s.ghost_due + ticks)

    return step


def publish_head(s: State) -> State:
    return replace(s, head=(s.head + 1) % (2 * SLOTS))


def read_tail(s: State) -> State:
    return replace(s, seen=(s.tail,))


def settle_seen(s: State) -> State:
    return replace(settle_to(s, s.seen[0]), seen=())


def read_now_low(
    s: State,
) -> State:  # a pointer is read in two bytes: one of a slot has a high byte, its low byte may be 0
    return replace(s, seen=(s.now % 2,))


def look_at_rest(s: State) -> State | None:
    """motion_poll(): at rest?"""
    high = 1 if s.now else 0
    return None if high or s.seen[0] else replace(s, seen=())


def arrive_or_start(s: State) -> State | None:
    check_promise(not s.fed and not s.pending, "the timer is started while it runs")
    if s.settled == s.head:
        check_promise(s.counts == s.ghost_edges == s.ghost_due, "the arm rests, and its count is not that of the pins")
        return None
    s = load_segment(s)
    check_promise(s.now != NONE, "the timer is started with nothing to do")
    return replace(s, left=s.left - 1)


def read_running(s: State) -> State:
    return replace(s, seen=(s.tail, s.now, s.left, s.ghost_edges - s.pending))


def read_running_first(s: State) -> State:
    return replace(s, seen=(s.tail, s.now))


def read_running_then(s: State) -> State:
    return replace(s, seen=(*s.seen, s.left, s.ghost_edges - s.pending))


def tell_count(s: State) -> State:
    tail, running, left, edges = s.seen
    s = settle_to(s, tail)
    check_promise(ticks_out(s, running, left) == edges, "a count is told that the pins never had")
    return replace(s, seen=())


def stretch_low(s: State) -> State:
    return replace(s, stretch=(s.stretch[0], 1))


def stretch_high(s: State) -> State:
    return replace(s, stretch=(2, s.stretch[1]))


def stop_timer(s: State) -> State:
    s = replace(s, fed=False)
    if s.pending:
        s = replace(interrupt(s), fed=False)
    return s


def stop_timer_forgetting(s: State) -> State:
    return replace(s, fed=False, pending=False)


def stand_still(s: State) -> State:
    return replace(stand_still_prepared(s), prepared=False)


def stand_still_prepared(s: State) -> State:
    s = settle_to(s, s.tail)
    s = replace(s, counts=ticks_out(s, s.now, s.left), now=NONE, left=0, stretch=(1, 0))
    check_promise(s.counts == s.ghost_edges, "a hold ends with a count that is not that of the pins")
    return replace(s, head=s.tail, settled=s.tail, slots=(0,) * SLOTS, ghost_due=s.counts)


SETTLE: tuple[Step, ...] = (read_tail, settle_seen)
CALLS: dict[str, tuple[Step, ...]] = {
    **{f"append {n}": (write_segment(n), publish_head) for n in TICKS},
    "poll": (*SETTLE, read_now_low, look_at_rest, *SETTLE, arrive_or_start),
    "counts": (lock_interrupts, read_running, unlock_interrupts, tell_count),
    "hold": (lock_interrupts, stretch_low, stretch_high, unlock_interrupts),
    "stand still": (lock_interrupts, stop_timer, unlock_interrupts, stand_still),
}
# What would go wrong without each of the precautions.
MUTANTS: dict[str, tuple[str, tuple[Step, ...]]] = {
    "published before it is written": ("append 2", (publish_head, write_segment(2))),
    "looked at once": ("poll", (*SETTLE, read_now_low, look_at_rest, arrive_or_start)),
    "counted without a lock": ("counts", (read_running_first, read_running_then, tell_count)),
    "stretched without a lock": ("hold", (stretch_low, stretch_high)),
    "rates of a segment that a stop has dropped": (
        "stand still",
        (lock_interrupts, stop_timer, unlock_interrupts, stand_still_prepared),
    ),
    "an edge forgotten at the stop": (
        "stand still",
        (lock_interrupts, stop_timer_forgetting, unlock_interrupts, stand_still),
    ),
}


def successors(s: State, calls: dict[str, tuple[Step, ...]]) -> Iterator[State]:
    if s.fed and not s.pending:
        yield replace(s, fed=False, pending=True, ghost_edges=s.ghost_edges + 1)
    if s.pending and not s.locked:
        interrupted = interrupt(s)
        yield interrupted
        yield prepare_short_tick(interrupted)
    if not s.call:
        yield from (replace(s, call=name) for name in calls)
        return
    steps = calls[s.call]
    after = steps[s.at](s)
    if after is None or s.at + 1 == len(steps):
        yield replace(after or s, call="", at=0, seen=(), locked=False)
    else:
        yield replace(after, at=s.at + 1)


def explore_states(calls: dict[str, tuple[Step, ...]]) -> tuple[int, str]:
    """States that any interleaving reaches, and the promise that one of them breaks ("": none)."""
    waiting = [State()]
    reached = set(waiting)
    while waiting:
        state = waiting.pop()
        try:
            for after in successors(state, calls):
                if after not in reached:
                    reached.add(after)
                    waiting.append(after)
        except BrokenError as broken:
            return len(reached), str(broken)
    return len(reached), ""
