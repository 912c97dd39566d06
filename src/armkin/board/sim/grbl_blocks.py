"""Planner blocks of a simulated GRBL: straight lines in steps, and how fast one goes over into the next.

GRBL does not stop between two lines: it passes a corner as fast as its junction deviation allows (planner.c), along one
line at full speed. Here a block knows the next one alone, and can stop at the end of that.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

JUNCTION_DEVIATION = 11  # setting [units]
_ARRIVED = 1e-6  # way [units] that is left to where rounding ends it
_STRAIGHT = 0.999999  # cosine of the turn beyond which a corner is none, or a way back


@dataclass
class Block:
    """A straight line in steps."""

    start: tuple[int, ...]
    end: tuple[int, ...]
    length: float  # [units]
    feed: float  # [units/s] as asked for
    max_speed: float  # [units/s] that the axes allow
    accel: float  # [units/s2]
    jog: bool = False
    distance_done: float = 0.0  # [units]
    rate: float = 0.0  # [units/s]
    line: bool = True  # False: a dwell, `distance_done` counts seconds up to `length`

    def advance(self, seconds: float, override: int, is_holding: bool, end_speed: float = 0.0) -> float:
        """Go on for some seconds; the share of the way that is done. end_speed: [units/s] at the end, at most."""
        change, before = self.accel * seconds, self.rate
        highest = 0.0
        if not is_holding:
            # from the rate v after these seconds it slows down to the end's over what is left then:
            # v^2 + change v = end^2 + 2 accel left - change before
            room = end_speed**2 + 2 * self.accel * (self.length - self.distance_done) - change * before
            highest = min(self.speed(override), 0.5 * (math.sqrt(max(change**2 + 4 * room, 0.0)) - change))
        self.rate = min(max(highest, before - change, 0.0), before + change)
        self.distance_done = min(self.length, self.distance_done + 0.5 * (before + self.rate) * seconds)
        if self.length - self.distance_done < _ARRIVED:
            self.distance_done = self.length
        return self.distance_done / self.length if self.length else 1.0

    def speed(self, override: int) -> float:
        """The speed [units/s] that it reaches, with a feed override [%]."""
        return min(self.feed * override / 100, self.max_speed)


def block_to(
    settings: Mapping[int, float], start: Sequence[int], goal: Sequence[float], feed: float, jog: bool
) -> Block | None:
    """A block to a goal in units; None: nothing to do."""
    end = [round(value * settings[100 + k]) for k, value in enumerate(goal)]
    change = _travel(settings, start, end)
    length = math.hypot(*change)
    if length == 0.0:
        return None
    direction = [travel / length for travel in change]
    max_speed = _least_share(settings, 110, direction) / 60
    return Block(tuple(start), tuple(end), length, feed, max_speed, _least_share(settings, 120, direction), jog)


def advance_first(
    blocks: Sequence[Block], settings: Mapping[int, float], seconds: float, override: int, is_holding: bool
) -> float:
    """The share of the first block's way that is done after some seconds; at its end the next one goes on as fast."""
    block, after = blocks[0], blocks[1] if len(blocks) > 1 and blocks[1].line else None
    end_speed = 0.0 if after is None else junction_speed(settings, block, after, override)
    share = block.advance(seconds, override, is_holding, end_speed)
    if after is not None and share == 1.0:
        after.rate = min(block.rate, end_speed)
    return share


def junction_speed(settings: Mapping[int, float], before: Block, after: Block, override: int) -> float:
    """How fast [units/s] one block goes over into the next, as GRBL's plan_buffer_line has it."""
    one, other = (
        [travel / block.length for travel in _travel(settings, block.start, block.end)] for block in (before, after)
    )
    cosine = sum(a * b for a, b in zip(one, other, strict=True))
    nominal = min(before.speed(override), after.speed(override), math.sqrt(2 * after.accel * after.length))
    if abs(cosine) > _STRAIGHT:
        return nominal if cosine > 0 else 0.0
    half = math.sqrt(0.5 * (1 + cosine))  # the sine of half the angle between the two lines
    change = [b - a for a, b in zip(one, other, strict=True)]
    size = math.hypot(*change)
    accel = _least_share(settings, 120, [x / size for x in change])
    return min(nominal, math.sqrt(accel * settings[JUNCTION_DEVIATION] * half / (1 - half)))


def _travel(settings: Mapping[int, float], start: Sequence[int], end: Sequence[int]) -> list[float]:
    """The way [units] from steps to steps."""
    return [(b - a) / settings[100 + k] for k, (a, b) in enumerate(zip(start, end, strict=True))]


def _least_share(settings: Mapping[int, float], first: int, direction: Sequence[float]) -> float:
    """The most that settings of the axes, from `first` on, allow along a direction."""
    return min(settings[first + k] / abs(share) for k, share in enumerate(direction) if share)
