"""The Raspberry Pi Pico: its build, and the compiled firmware in the emulator (rp2040js)."""

from __future__ import annotations

import struct
import subprocess
import zlib
from collections.abc import Iterator
from dataclasses import replace

import pytest
from bare_host import WIDE, BareHost, Batch, cut_batches, image_for
from emulator import BUILD, PICO, EmulatedBoard, build_firmware
from golden import read_talks
from measure_pico import CLOCK, KNOWN, SIX, measure_stepping, net_steps, ready_host, segments_per_second

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Error, Flag, State, whole_steps

MODERATE = replace(WIDE, lower=-50_000, upper=50_000, max_rate=8000, max_accel=160_000)
TMC2209 = {"step_high": 1, "step_low": 1, "dir_setup": 1, "wake": 1}


@pytest.fixture
def board() -> Iterator[EmulatedBoard]:
    with EmulatedBoard(PICO, speed="step", trace=True, driver="drv8825") as emulated:
        emulated.run(0.01)
        yield emulated


def move_x(host: BareHost, start: int, steps: int) -> None:
    """X by `steps`, at 8,000 steps/s."""
    segment = whole_steps(abs(steps), CLOCK // 8000, 0, (steps,))
    host.order(Batch((0,), (start,), (segment,), at_rest=True).payload(0))


def under_way(board: EmulatedBoard, *, power_sensed: bool = False) -> BareHost:
    """X has gone 0.2 of 2.5 s at 8,000 steps/s."""
    host = ready_host(board, MODERATE, power_sensed=power_sensed)
    move_x(host, 0, 20_000)
    host.run(0.2)
    return host


def end_status(host: BareHost, error: Error, known: int) -> protocol.Status:
    """The motion was ended by an error; the board's count of X is that of the pins."""
    status = host.rest()
    assert (status.error, status.known) == (error, known)
    assert status.counts[0] == net_steps(host.board)[0]
    return status


# The build


def test_the_uf2_file_is_what_a_pico_takes() -> None:
    file = build_firmware(PICO).read_bytes()
    assert len(file) % 512 == 0
    flash = b""
    for offset in range(0, len(file), 512):
        *head, data, end = struct.unpack("<8I476sI", file[offset : offset + 512])
        address = 0x1000_0000 + len(flash)
        assert head == [0x0A324655, 0x9E5D5157, 0x2000, address, 256, offset // 512, len(file) // 512, 0xE48BFF56]
        assert end == 0x0AB16F30
        flash += data[:256]

    def mirror_bits(x: int, bits: int) -> int:
        return int(f"{x:0{bits}b}"[::-1], 2)

    # The boot ROM's CRC-32 is zlib's, but with all bits mirrored and not inverted at the end.
    reflected = zlib.crc32(bytes(mirror_bits(byte, 8) for byte in flash[:252])) ^ 0xFFFFFFFF
    assert struct.unpack("<I", flash[252:256])[0] == mirror_bits(reflected, 32)
    stack, start = struct.unpack("<II", flash[256:264])
    assert stack == 0x2004_0000
    assert start & 1
    assert 0x1000_01C0 <= start < 0x1000_0000 + len(flash)


def test_it_fits_the_memory_with_room_for_the_stack() -> None:
    build_firmware(PICO)  # -Wall -Wextra -Werror
    command = ["arm-none-eabi-size", "-A", str(BUILD / f"{PICO}.elf")]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    size = {line.split()[0]: int(line.split()[1]) for line in lines if line.startswith(".")}
    assert size[".boot2"] == 256
    assert size[".text"] + size[".bss"] < 256 * 1024 - 4096
    assert size[".noinit"] <= 4096


# Steps


def test_six_axes_at_250_khz_and_every_edge_is_where_the_protocol_puts_it() -> None:
    """Also while every interrupt comes 0.48 us late, which another one of 60 cycles would make."""
    measured = measure_stepping(CLOCK // 250_000, ticks=1500, held_off_us=0.48)
    assert measured.exact
    assert (measured.rate, measured.off_us, measured.overruns, measured.violations) == (250_000, 0, 0, 0)
    assert measured.high_us == pytest.approx(1.92)
    assert measured.asleep > 0.3


def test_interrupts_that_come_later_than_there_is_room_for_are_told() -> None:
    late = measure_stepping(CLOCK // 250_000, ticks=1500, held_off_us=0.64)
    assert (late.exact, late.error) == (False, Error.OVERRUN)


def test_the_shortest_interval_leaves_the_driver_its_times(board: EmulatedBoard) -> None:
    """Every segment turns every axis round, 100 cycles a tick (250 kHz), with the times of a DRV8825."""
    host = ready_host(board, replace(WIDE, max_rate=250_000, max_accel=(1 << 24) - 1))
    work = tuple(whole_steps(10, 100, 0, ((-1) ** n * 10,) * 6) for n in range(6))
    host.order(Batch(SIX, (0,) * 6, work, at_rest=True).payload(0))
    host.run(0.01)
    assert host.rest().overruns == 0
    for figures in board.stats()["axes"].values():
        assert figures["positive"] + figures["negative"] == 60
        assert sum(figures["violations"].values()) == 0
        assert figures["dir_setup_min_us"] >= 0.65


# What stops a motion


def test_a_limit_switch_stops_within_a_ramp_and_lets_the_axis_leave(board: EmulatedBoard) -> None:
    board.control("set-switch C at 3000 above")
    guards = (*[protocol.GuardImage()] * 5, protocol.GuardImage(False, (0, 0, 0, 0, 0, 1, 0, 0)))
    host = ready_host(board, MODERATE, guards=guards)
    segment = whole_steps(20_000, CLOCK // 8000, 0, (20_000,))
    host.order(Batch((5,), (0,), (segment,), at_rest=True).payload(0))
    host.run(0.3)
    host.status()
    status = host.rest()
    assert (status.error, status.detail, status.known) == (Error.LIMIT_SWITCH, 5, 0xFF)
    # 3 ms until it counts, then a ramp of 8000 / 160000 s
    assert 3000 + 8000 * 0.025 < status.counts[5] < 3000 + 8000 * (0.025 + 0.006)
    assert status.counts[5] == net_steps(board)[5]
    host.hello(2)
    refused = host.ask(Batch((5,), (status.counts[5],), (segment,), at_rest=True).payload(0), protocol.Ack)
    assert refused.error == Error.LIMIT_SWITCH
    host.hello(3)
    away = whole_steps(500, CLOCK // 8000, 0, (-500,))
    host.order(Batch((5,), (status.counts[5],), (away,), at_rest=True).payload(0))
    assert host.rest().counts[5] == status.counts[5] - 500 == net_steps(board)[5]


def test_the_abort_input_holds_and_forbids(board: EmulatedBoard) -> None:
    host = under_way(board)
    board.control("pin GP26 0")
    host.run(0.2)
    status = end_status(host, Error.ABORT, 0xFF)
    assert status.flags & Flag.ABORT
    host.hello(2)
    assert host.ask(protocol.jog(0, (100, *[0] * 7)), protocol.Ack).error == Error.ABORT
    board.control("pin GP26 z")
    host.run(0.02)
    host.hello(3)
    host.order(protocol.jog(0, (100, *[0] * 7)))


def test_a_cut_of_the_motors_power_is_a_lost_position(board: EmulatedBoard) -> None:
    board.control("pin GP27 1")
    host = under_way(board, power_sensed=True)
    board.control("pin GP27 0")
    host.run(0.2)
    end_status(host, Error.POWER, 0)


def test_a_silent_host_is_a_hold_with_exact_counts(board: EmulatedBoard) -> None:
    host = under_way(board)
    board.control("cut both")
    host.run(1.0)
    board.control("restore")
    status = host.status()
    assert (status.state, status.error, status.known) == (State.IDLE, Error.SILENCE, 0xFF)
    assert status.counts[0] == net_steps(board)[0] == pytest.approx(8000 * (0.5 + 0.05 / 2), rel=0.02)


# Homing, resets, servos


@pytest.mark.parametrize("count", [-1000, 40])
def test_homing_latches_the_switch_to_the_step(board: EmulatedBoard, count: int) -> None:
    board.control(f"set-switch B at {count} below")
    host = ready_host(board, MODERATE)
    rate = (0, 0, 0, 0, -4000, 0, 0, 0)
    host.order(protocol.home(0, switch=4, closed=False, slow=26, backoff=100, travel=8000, time=200, rate=rate))
    status = host.rest()
    assert (status.error, bool(status.flags & Flag.LATCH)) == (0, True)
    assert host.status(page=1).counts[4] == count
    assert status.counts[4] == net_steps(board)[4]


@pytest.mark.parametrize("cause", ["external", "watchdog", "power"])
@pytest.mark.parametrize("moving", [False, True])
def test_only_a_reset_at_rest_keeps_the_position(board: EmulatedBoard, cause: str, moving: bool) -> None:
    host = ready_host(board, MODERATE)
    move_x(host, 0, 1000)
    host.run(0.05 if moving else 0.2)
    board.control(f"reset {cause}")
    host.run(0.02)
    info = host.hello(2)
    assert info.cause == {"external": 2, "watchdog": 8, "power": 1}[cause]
    if not moving and cause != "power":
        assert (info.known, info.boots) == (0x3F, 2)  # nothing holds a servo without pulses
        assert info.flags == Flag.DRIVERS | Flag.CONFIGURED | Flag.RETAINED
        assert host.status().counts[0] == net_steps(board)[0] == 1000
    else:
        assert (info.known, info.config) == (0, 0)
    stood = net_steps(board)
    host.run(0.2)
    assert net_steps(board) == stood


def test_a_program_that_hangs_is_reset_by_the_watchdog(board: EmulatedBoard) -> None:
    host = ready_host(board, MODERATE)
    board.control("hang")
    host.run(0.3)
    info = host.hello(2)
    assert (info.cause, info.known, info.boots) == (8, 0x3F, 2)


def test_servos_are_silent_until_consent_then_exact(board: EmulatedBoard) -> None:
    host = BareHost(board)
    host.configure(image_for(PICO, MODERATE, **TMC2209), KNOWN)
    host.run(0.1)
    assert all(s["pulses"] == 0 for s in board.stats()["servos"].values())
    host.order(protocol.enable(0, 2))
    host.run(0.1)
    board.control("clear")
    work = (whole_steps(400, CLOCK // 1000, 0, (400, -400)),)
    host.order(Batch((6, 7), (1500, 1500), work, at_rest=True).payload(0))
    host.run(0.4)
    assert host.rest().counts[6:] == (1900, 1100)
    host.run(0.05)
    board.control("clear")
    host.run(0.1)
    for servo, width in zip(board.stats()["servos"].values(), (1900, 1100), strict=True):
        assert servo["pulses"] >= 4
        assert servo["width_min_us"] == pytest.approx(width, abs=0.1)
        assert servo["width_max_us"] == pytest.approx(width, abs=0.1)
        assert servo["period_min_us"] == pytest.approx(20_000, abs=1)


def test_noise_moves_nothing_that_was_not_sent(board: EmulatedBoard) -> None:
    host = ready_host(board, replace(WIDE, max_rate=20_000, max_accel=1_000_000))
    board.control("noise flip 0.01 drop 0.01 seed 5 dir both")
    share, segments = (3, -5, 2, 1, -1, 4), 60
    counts: tuple[int, ...] = (0,) * 6
    sessions = 0
    end = tuple(segments * s for s in share)
    while counts != end and sessions < 100:
        sessions += 1
        host.hello(1000 + sessions)
        left = (end[0] - counts[0]) // share[0]
        work = [whole_steps(12, 25_000, 0, share)] * left
        remainder = tuple(e - a - left * s for e, a, s in zip(end, counts, share, strict=True))
        work += [whole_steps(20, 25_000, 0, remainder)] if any(remainder) else []
        status = host.stream(cut_batches(SIX, counts, work, 3), resend=0.012, slice_s=2e-3, window=3, poll=0.05)
        counts = status.counts[:6]
    board.control("restore")
    assert counts == end == net_steps(board)


# USB


@pytest.mark.parametrize("name", ["move_pico6.talk", "refuse_pico6.talk"])
def test_the_golden_conversations_over_usb(name: str) -> None:
    talk = next(t for t in read_talks() if t.name == name)
    with EmulatedBoard(PICO, speed="step", link="usb") as board:
        board.run(0.05)  # until the host has set it up
        assert talk.replay(board) > 10
        usb = board.stats()["usb"]
        assert usb["connected"]
        assert usb["received"] > 500
        assert board.stats()["uart"]["received"] == 0


def test_twenty_thousand_segments_a_second_over_usb() -> None:
    rate, exact = segments_per_second("usb", SIX, 20_000, batch=11)
    assert exact
    assert rate >= 19_999


def test_fifteen_hundred_segments_a_second_over_the_uart() -> None:
    rate, exact = segments_per_second("uart", (0, 1, 2, 3), 1_550, batch=14, count=400)
    assert exact
    assert rate >= 1_500


def test_a_tick_that_is_brought_too_late_is_told_and_ends_in_a_hold(board: EmulatedBoard) -> None:
    host = under_way(board)
    board.control("absent 200us")  # an edge is due every 125 us
    host.run(0.1)
    status = end_status(host, Error.OVERRUN, 0xFF)
    assert 8000 * 0.2 < status.counts[0] < 8000 * 0.3


def test_1200_baud_on_the_usb_lead_to_the_boot_drive_from_rest_alone() -> None:
    """What `armkin flash` does to a Pico that runs armkin; datasheet 2.8.3: reset_to_usb_boot."""
    with EmulatedBoard(PICO, speed="step", trace=True, link="usb", driver="drv8825") as board:
        board.run(0.1)  # the host sets the device up
        for rate in (115200, 250000):
            board.control(f"line-coding {rate}")
            board.run(0.01)
            assert board.stats()["state"] == "running"
        host = under_way(board)
        board.control("line-coding 1200")
        host.run(0.01)
        assert board.stats()["state"] == "running", "an arm that moves is not left alone"
        host.run(3.0)
        assert board.stats()["state"] == "running", "and what was refused is not done later"
        board.control("line-coding 1200")
        board.run(0.01)
        assert board.stats()["state"] == "boot drive"
        board.control("reset power")
        board.run(0.1)
        assert board.stats()["state"] == "running"
