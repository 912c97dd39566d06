"""armkin's sender before the compiled firmware, at every latency, in simulated time: no load changes what happens."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from emulator import EmulatedBoard
from stepped_port import SteppedPort

import armkin
from armkin.board.firmware import streaming
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.wire.protocol import Ack, Error, Info, Status

ARM = armkin.load("three_dof")


@pytest.mark.parametrize("one_way_ms", [0.0, 0.5, 1.0, 4.0, 16.0])
@pytest.mark.parametrize("load", [0.0, 3.0], ids=["quiet", "busy"])
def test_short_moves_lose_no_byte(monkeypatch: pytest.MonkeyPatch, load: float, one_way_ms: float) -> None:
    monkeypatch.setattr(streaming, "_processor_load", lambda session: load)
    spilled = 0
    with EmulatedBoard(speed="step", reset_on_open=False) as board:
        port = SteppedPort(board, one_way_ms / 1e3)
        port.wait(0.02)
        machine = FirmwareMachine(port, ARM, configure(ARM))
        machine.prepare(assume=ARM.home)
        hear = machine.session.line.replies

        def replies(timeout: float) -> Iterator[Ack | Info | Status]:
            nonlocal spilled
            for reply in hear(timeout):
                spilled += isinstance(reply, Ack) and reply.detail == Error.SPILL and not reply.error
                yield reply

        monkeypatch.setattr(machine.session.line, "replies", replies)
        counts = machine.counts()
        for degrees in ([4, -3, 5], [-5, 6, 2], [0.3, 0.1, -0.2], [1.65, 1.4, 0.35]):
            plan = machine.plan(counts, ARM.home + np.deg2rad(degrees))
            machine.run([plan])
            counts = machine.counts()
            assert counts == tuple(plan.end.tolist())
        stats = board.stats()
        assert [stats["axes"][axis]["net"] for axis in "XYZ"] == list(counts)
        assert (spilled, machine.session.line.resent, stats["uart"]["overruns"], machine.status.bad) == (0, 0, 0, 0)


def test_the_first_step_comes_within_10_ms_of_the_first_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    """The law has it 8.4 ms after rest; until then no motor tells how it got there, and the board lets it be sooner."""
    monkeypatch.setattr(streaming, "_processor_load", lambda session: 0.0)
    with EmulatedBoard(speed="step", reset_on_open=False, trace=True) as board:
        port = SteppedPort(board, 0.0005)
        port.wait(0.02)
        machine = FirmwareMachine(port, ARM, configure(ARM))
        machine.prepare(assume=ARM.home)
        plan = machine.plan(machine.counts(), np.deg2rad([-3, 0.5, -0.5]))
        port.wait(0.03)
        begin = board.control("cycles")["cycle"]
        machine.run([plan])
        trace = board.trace()
        arrived, _ = trace.edges("uart.in")
        step = min(trace.rises(f"{axis}.STEP")[0] for axis in "XYZ")
        assert 0.005 < (step - arrived[arrived > begin][0]) / board.clock_hz < 0.01
