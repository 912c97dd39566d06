"""The Raspberry Pi Pico: its build, and the compiled firmware in the emulator (rp2040js)."""

from __future__ import annotations

import struct
import subprocess
import zlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from bare_host import WIDE, BareHost, Batch, batches, image_for
from emulator import BUILD, PICO, EmulatedBoard, build_firmware

from armkin.board.firmware import protocol
from armkin.board.firmware.protocol import whole

CLOCK = 25_000_000
CYCLES = 5  # of the emulator's cycle counter, one of the board's clock
SIX = (0, 1, 2, 3, 4, 5)
KNOWN = {**dict.fromkeys(SIX, 0), 6: 1500, 7: 1500}
MODERATE = replace(WIDE, lower=-50_000, upper=50_000, max_rate=8000, max_accel=160_000)
TMC2209 = {"step_high": 1, "step_low": 1, "dir_setup": 1, "wake": 1}
DRV8825 = {"step_high": 19, "step_low": 19, "dir_setup": 7, "wake": 2}


@pytest.fixture
def board() -> Iterator[EmulatedBoard]:
    with EmulatedBoard(PICO, speed="step", trace=True, driver="drv8825") as emulated:
        emulated.run(0.01)
        yield emulated


def ready(board: EmulatedBoard, axis: protocol.AxisImage = MODERATE, **changes: object) -> BareHost:
    host = BareHost(board)
    host.setup(replace(image_for(PICO, axis, **DRV8825), **changes), KNOWN)  # type: ignore[arg-type]
    return host


def move(host: BareHost, start: int, steps: int) -> None:
    """X by `steps`, at 8,000 steps/s."""
    segment = whole(abs(steps), CLOCK // 8000, 0, (steps,))
    host.order(Batch((0,), (start,), (segment,), at_rest=True).payload(0))


def net(board: EmulatedBoard) -> tuple[int, ...]:
    return tuple(board.net().values())


# The build


def test_the_uf2_file_is_what_a_pico_takes() -> None:
    file = build_firmware(PICO).read_bytes()
    assert len(file) % 512 == 0
    flash = b""
    for at in range(0, len(file), 512):
        *head, data, end = struct.unpack("<8I476sI", file[at : at + 512])
        address = 0x1000_0000 + len(flash)
        assert head == [0x0A324655, 0x9E5D5157, 0x2000, address, 256, at // 512, len(file) // 512, 0xE48BFF56]
        assert end == 0x0AB16F30
        flash += data[:256]

    def mirrored(x: int, bits: int) -> int:
        return int(f"{x:0{bits}b}"[::-1], 2)

    # The boot ROM's CRC-32 is zlib's, but with all bits mirrored and not inverted at the end.
    reflected = zlib.crc32(bytes(mirrored(byte, 8) for byte in flash[:252])) ^ 0xFFFFFFFF
    assert struct.unpack("<I", flash[252:256])[0] == mirrored(reflected, 32)
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


def test_six_axes_make_exactly_their_steps_at_100_khz_and_no_edge_is_off(board: EmulatedBoard) -> None:
    """100,000 steps/s on each of six axes, every edge where PROTOCOL.md puts it."""
    fast = replace(WIDE, max_rate=150_000, max_accel=1 << 23)
    host = ready(board, fast)
    ticks = 1000
    ramp = [whole(100, interval, 0, (100,) * 6) for interval in (1000, 500, 333, 300)]
    flat = [whole(ticks, 250, 0, (ticks, -ticks, ticks, -ticks, ticks, (-1) ** n * ticks)) for n in range(1)]
    segments = [
        replace(s, rates=tuple(r * d for r, d in zip(s.rates, (1, -1, 1, -1, 1, 1), strict=True))) for s in ramp
    ]
    segments += flat + segments[::-1]
    work = batches(SIX, (0,) * 6, segments, 4)
    status = host.stream(work)
    assert (status.error, status.overruns) == (0, 0)
    assert status.counts[:6] == work[-1].end == net(board)
    assert abs(work[-1].end[0]) == 1800
    trace = board.trace()
    rises = [trace.rises(f"{axis}.STEP") for axis in "XYZABC"]
    assert all(np.array_equal(rises[0], other) for other in rises)  # all six at the same cycle
    gaps = np.diff(rises[0])
    intervals = np.repeat([s.interval for s in segments], [s.ticks for s in segments]) * CYCLES
    assert len(gaps) == 1799
    # One step a tick but for 2^-16: the phase lags by a tick now and then
    assert np.abs(np.cumsum(gaps) - np.cumsum(intervals[1:1800])).max() <= 5 * 1000
    cruise = gaps[(gaps > 0.9 * 1250) & (gaps < 1.1 * 1250)]
    assert len(cruise) > 900
    assert np.ptp(cruise) == 0
    figures = board.stats()["axes"]
    for axis in "XYZABC":
        assert sum(figures[axis]["violations"].values()) == 0
    assert min(f["high_min_us"] for f in figures.values()) >= 1.9
