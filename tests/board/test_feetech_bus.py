"""The servo bus: our packets against the maker's own library, and a line that loses and damages packets."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
import scservo_sdk as sdk

from armkin.board.feetech import packet, registers
from armkin.board.feetech.bus import Bus
from armkin.board.feetech.packet import Splitter
from armkin.board.sim.sim_servo_bus import Noise, Servo, ServoBus
from armkin.errors import LinkError
from pty_port import PtyPort

SIX = range(1, 7)


def ask_patiently(ask: Callable[[], Any], right: Callable[[Any], bool]) -> Any:
    """The library's answer; its packets time out after some milliseconds, which a busy computer lets pass."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        with suppress(IndexError):  # what the library makes of half an answer
            if right(answer := ask()):
                return answer
    raise AssertionError("no right answer in a minute")


def test_the_makers_library_drives_the_simulated_servos() -> None:
    bus = ServoBus(Servo(number, 1000 + number) for number in SIX)
    with PtyPort(bus) as pty:
        port, maker = sdk.PortHandler(pty.name), sdk.PacketHandler(0)
        assert port.openPort()
        port.setBaudRate(1_000_000)
        for number in SIX:  # a late answer to the question before is no right one
            ask_patiently(partial(maker.ping, port, number), lambda answer: answer == (777, 0, 0))
            ask_patiently(partial(maker.read2ByteTxRx, port, number, 56), (1000 + number, 0, 0).__eq__)
        assert maker.ping(port, 9)[1] != 0

        ask_patiently(lambda: maker.write1ByteTxRx(port, 3, 40, 1), lambda answer: answer == (0, 0))
        ask_patiently(lambda: maker.write2ByteTxRx(port, 3, 46, 2000), lambda answer: answer == (0, 0))
        goals = sdk.GroupSyncWrite(port, maker, 42, 2)
        goals.addParam(3, [2000 & 0xFF, 2000 >> 8])
        goals.txPacket()
        ask_patiently(lambda: maker.read2ByteTxRx(port, 3, 56), lambda answer: answer == (2000, 0, 0))
        places = sdk.GroupSyncRead(port, maker, 56, 2)
        for number in SIX:
            places.addParam(number)
        ask_patiently(places.txRxPacket, lambda answer: answer == 0)
        assert [places.getData(number, 56, 2) for number in SIX] == [1001, 1002, 2000, 1004, 1005, 1006]
        port.closePort()


def test_packets_are_those_of_the_makers_library() -> None:
    sent: list[list[int]] = []

    class Line:
        is_using = False

        def clearPort(self) -> None:  # noqa: N802
            """Nothing to clear."""

        def setPacketTimeout(self, length: int) -> None:  # noqa: N802
            """No clock here."""

        def writePort(self, data: list[int]) -> int:  # noqa: N802
            sent.append(list(data))
            self.is_using = False
            return len(data)

    line, maker = Line(), sdk.PacketHandler(0)
    maker.writeTxOnly(line, 5, 42, 2, [0x34, 0x12])
    maker.readTx(line, 5, 56, 8)
    maker.syncWriteTxOnly(line, 42, 2, [1, 10, 0, 2, 20, 0], 6)
    maker.syncReadTx(line, 56, 2, [1, 2, 3], 3)
    assert [bytes(data) for data in sent] == [
        packet.write_registers(5, 42, b"\x34\x12"),
        packet.read_registers(5, 56, 8),
        packet.sync_write(42, {1: b"\x0a\x00", 2: b"\x14\x00"}),
        packet.sync_read([1, 2, 3], 56, 2),
    ]


@pytest.mark.parametrize("seed", range(5))
def test_lost_and_damaged_packets_are_asked_for_again(seed: int) -> None:
    port = ServoBus((Servo(number, 300 * number) for number in SIX), noise=Noise(0.01, 0.01, seed))
    bus = Bus(port)
    for _ in range(100):
        states = bus.states(SIX)
        places = [registers.POSITION.unpack(states[number], registers.STATE[0]) for number in SIX]
        assert places == [300 * number for number in SIX]
    bus.torque(SIX, on=True)
    assert all(servo.get(registers.TORQUE) == 1 for servo in port.servos.values())
    assert bus.repeats > 0


def test_a_servo_that_is_gone_is_named() -> None:
    bus = Bus(ServoBus([Servo(1), Servo(3)]))
    with pytest.raises(LinkError, match=r"servo 2 on sim does not answer: is its cable plugged in"):
        bus.states([1, 2, 3])


def test_whole_packets_come_out_of_any_bytes() -> None:
    rng = random.Random(4)
    packets = [packet.packet(rng.randrange(1, 253), 0, rng.randbytes(rng.randrange(9))) for _ in range(300)]
    splitter = Splitter()
    replies: list[Any] = []
    for whole_packet in packets:
        data = rng.randbytes(rng.randrange(3)).replace(b"\xff", b"") + whole_packet
        for k in range(0, len(data), 3):
            replies += splitter.feed(data[k : k + 3])
    assert [packet.packet(reply.id, reply.errors, reply.data) for reply in replies] == packets


@pytest.mark.parametrize("value", [0, 1, 2047, -1, -2047])
def test_signs_are_the_makers(value: int) -> None:
    word = int.from_bytes(registers.OFFSET.pack(value), "little")
    assert word == sdk.SCS_TOSCS(value, 11)
    assert registers.OFFSET.unpack(registers.OFFSET.pack(value), registers.OFFSET.address) == value
