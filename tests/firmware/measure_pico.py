"""The quality figures of the Pico's firmware, measured in the emulator in simulated time: they repeat to the cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from bare_host import WIDE, BareHost, Batch, cut_batches, image_for
from emulator import PICO, EmulatedBoard
from numpy.typing import NDArray

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import HALF, STEP, Segment, whole_steps

CLOCK = 25_000_000
CYCLES = 5  # of the emulator's cycle counter, one of the board's clock
SIX = (0, 1, 2, 3, 4, 5)
KNOWN = {**dict.fromkeys(SIX, 0), 6: 1500, 7: 1500}
DRV8825 = {"step_high": 19, "step_low": 19, "dir_setup": 7, "wake": 2}
FAST = replace(WIDE, max_rate=250_000, max_accel=(1 << 24) - 1)


def ready_host(
    board: EmulatedBoard, axis: protocol.AxisImage = FAST, *, baud: int = 250_000, **changes: object
) -> BareHost:
    """A host whose session is open, every axis known, drivers and servos on."""
    host = BareHost(board, baud)
    host.run(0.05)
    host.setup(replace(image_for(PICO, axis, **DRV8825), **changes), KNOWN)  # type: ignore[arg-type]
    return host


def net_steps(board: EmulatedBoard) -> tuple[int, ...]:
    return tuple(board.net().values())


def edges_by_the_protocol(segments: list[Segment], axis: int) -> NDArray[np.int64]:
    """Clock cycles from the start at which an axis's STEP rises: PROTOCOL.md, section 6, word for word."""
    edges, cycle, place = [], 0, HALF
    for segment in segments:
        interval, add = segment.interval << 16, segment.add * 256
        for tick in range(1, segment.ticks + 1):
            cycle += interval >> 16
            interval += add >> 8
            if segment.quick:
                add += 128 * segment.bend
            elif (segment.ticks - tick) % 16 == 0:
                add += 4 * segment.bend
            before = place // STEP
            place += segment.rates[axis]
            if place // STEP != before:
                edges.append(cycle)
    return np.array(edges, dtype=np.int64)


@dataclass(frozen=True)
class Stepping:
    """Six axes with one step a tick, under constant questions, servos on."""

    rate: float  # [Hz] of the cruise
    off_us: float  # the farthest that an edge is from where the protocol puts it, all axes
    exact: bool  # counts, pins and plan agree
    overruns: int
    violations: int  # of a DRV8825's times
    dir_setup_us: float
    high_us: float
    asleep: float  # share of the cruise in which the processor has nothing to do
    error: int


def measure_stepping(interval: int, ticks: int = 2000, held_off_us: float = 0.0) -> Stepping:
    """Up to one tick in `interval` cycles, there and back; every interrupt comes `held_off_us` later."""
    ramp = [i for i in (1000, 500, 333) if i > 1.1 * interval]
    pairs = [(100, i) for i in ramp] + [(ticks, interval)] + [(100, i) for i in reversed(ramp)]
    segments_out = [whole_steps(n, i, 0, tuple((-1) ** k * n for k in SIX)) for n, i in pairs]
    back = [replace(s, rates=tuple(-r for r in s.rates)) for s in segments_out]
    with EmulatedBoard(PICO, speed="step", trace=True, driver="drv8825") as board:
        host = ready_host(board)
        board.control(f"hold-off {held_off_us}us")
        board.control("clear")
        work = cut_batches(SIX, (0,) * 6, segments_out, 4)
        work += cut_batches(SIX, work[-1].end, back, 4)
        status = host.stream(work, poll=0.002)
        trace, figures = board.trace(), board.stats()["axes"].values()
        first, lateness = trace.rises("X.STEP")[0], 0.0
        begin = edges_by_the_protocol(segments_out, 0)[0]
        for axis, name in enumerate("XYZABC"):
            expected = edges_by_the_protocol(segments_out, axis) - begin
            came = trace.rises(f"{name}.STEP")[: len(expected)] - first
            lateness = max(lateness, float(np.abs(came - CYCLES * expected[: len(came)]).max()) / 125)
        exact = status.error == 0 and status.counts[:6] == work[-1].end == net_steps(board)
        exact = exact and all(f["positive"] == f["negative"] > ticks // 2 for f in figures)
        return Stepping(
            CLOCK / interval,
            lateness,
            exact,
            status.overruns,
            sum(sum(f["violations"].values()) for f in figures),
            min(f["dir_setup_min_us"] for f in figures),
            min(f["high_min_us"] for f in figures),
            asleep_at(interval, held_off_us),
            status.error,
        )


def asleep_at(interval: int, held_off_us: float) -> float:
    """Share of a cruise of all six axes in which the processor sleeps; no segments come."""
    ticks, step = 10_000, (1, -1, 1, -1, 1, -1)
    with EmulatedBoard(PICO, speed="step") as board:
        host = ready_host(board)
        board.control(f"hold-off {held_off_us}us")
        work = (
            whole_steps(200, 1000, 0, tuple(200 * s for s in step)),
            whole_steps(ticks, interval, 0, tuple(ticks * s for s in step)),
        )
        host.order(Batch(SIX, (0,) * 6, work, at_rest=True).payload(0))  # takes 20 ms
        board.control("clear")
        host.status()
        return float(board.stats()["asleep"])


def segments_per_second(
    link: Literal["uart", "usb"], axes: tuple[int, ...], rate: float, batch: int, count: int = 600, ticks: int = 2
) -> tuple[float, bool]:
    """Streams short segments; what came out at the pins a second, and whether all of it was exact."""
    with EmulatedBoard(PICO, speed="step", link=link) as board:
        host = ready_host(board, baud=250_000 if link == "uart" else 12_000_000)
        board.control("clear")
        interval = round(CLOCK / rate / ticks)
        # a pause in front, so that the queue is full when it matters
        work = [whole_steps(100, 60_000 if link == "uart" else 6000, 0, (0,) * len(axes))]
        segment = whole_steps(ticks, interval, 0, tuple((-1) ** k for k in range(len(axes))))
        plan = cut_batches(axes, (0,) * len(axes), work + [segment] * count, batch)
        status = host.stream(plan, slice_s=0.25e-3)
        x = board.stats()["axes"]["X"]
        seconds = (x["last_step_cycle"] - x["first_step_cycle"]) / board.clock_hz
        exact = status.error == 0 and status.counts[: len(axes)] == plan[-1].end
        return (count - 1) / seconds, exact


def first_step_ms(link: Literal["uart", "usb"]) -> float:
    """From the end of the first batch's last byte to the first edge, at rest."""
    with EmulatedBoard(PICO, speed="step", trace=True, link=link) as board:
        host = ready_host(board)
        work = (whole_steps(50, 2500, 0, (50,) * 6),)
        before = int(board.control("cycles")["cycle"])
        payload = Batch(SIX, (0,) * 6, work, at_rest=True).payload(0)
        host.order(payload)
        step = int(board.trace().rises("X.STEP")[0])
        line = 10 * len(protocol.encode_frame(payload)) / 250_000 if link == "uart" else 0.0
        return (step - before) / board.clock_hz * 1e3 - line * 1e3
