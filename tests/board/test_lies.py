"""Boards that say what cannot be, stand still or are taken over: senders end in bounded time, never with success."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armkin.board.firmware import protocol
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.cutting import plan as plan_moves
from armkin.board.firmware.heed import BoardSaysError, ReplacedError
from armkin.board.firmware.machine import Machine
from armkin.board.firmware.protocol import Info, Status
from armkin.board.sim.board import SimBoard
from armkin.board.sim.port import SimPort
from armkin.errors import LinkError
from armkin.hardware import BOARDS
from armkin.model import build as arms
from armkin.model.arm import Arm


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return arms.load("robots/three_dof.yaml")


class LyingPort(SimPort):
    """A simulated board whose replies are changed on their way, once `lying`."""

    def __init__(self, **lies: int | tuple[int, ...]) -> None:
        super().__init__(SimBoard(BOARDS["uno_cnc_shield"]))
        self.simulated, self.lying, self._lies = False, False, lies
        self._splitter = protocol.Splitter()

    def read(self, timeout: float) -> bytes:
        data = super().read(timeout)
        return b"".join(self._changed(payload) for payload in self._splitter.feed(data))

    def _changed(self, payload: bytes) -> bytes:
        reply = protocol.parse(payload)
        assert reply is not None
        if self.lying:
            reply = replace(reply, **{k: v for k, v in self._lies.items() if hasattr(reply, k)})  # type: ignore[arg-type]
        pack = {Info: protocol.pack_info, Status: protocol.pack_status}.get(type(reply), protocol.pack_ack)
        return protocol.wire(pack(reply))  # type: ignore[operator]


INFO_LIES: list[dict[str, int]] = [
    {"clock": 0},
    {"min_interval": 0},
    {"min_interval": 65535},
    {"frame": 8},
    {"queue": 0},
    {"receive": 0},
    {"axes": 0},
    {"boots": 0},
    {"known": 0xFFFF},
]


@pytest.mark.parametrize("lie", INFO_LIES, ids=str)
def test_an_info_that_cannot_be_is_refused(three_dof: Arm, lie: dict[str, int]) -> None:
    port = LyingPort(**lie)
    port.lying = True
    with pytest.raises(BoardSaysError, match=f"says {next(iter(lie))} "):
        Machine(port, three_dof, configure(three_dof))


RUN_LIES: list[dict[str, int | tuple[int, ...]]] = [
    {"state": 5},
    {"state": 255},
    {"error": 32},
    {"error": 255},
    {"free": 33},
    {"next": 200},
    {"counts": ()},
    {"counts": (0, 0, 0)},
    {"known": 0},
    {"known": 0xFFFF},
    {"overruns": 3},
    {"session": 1},
    {"state": 1},  # never comes to rest
    {"state": 3},
    {"free": 0},  # never takes more
    {"next": 0},  # never goes on
]


@pytest.mark.parametrize("lie", RUN_LIES, ids=str)
def test_a_lie_in_motion_ends_the_sender_in_bounded_time(three_dof: Arm, lie: dict[str, int | tuple[int, ...]]) -> None:
    port = LyingPort(**lie)
    one = Machine(port, three_dof, configure(three_dof))
    one.prepare(assume=one.arm.home)
    plan = plan_moves(three_dof, one.counts(), np.deg2rad([30, 60, -60]))
    port.lying = True
    begin = port.now()
    with pytest.raises(LinkError):
        one.run([plan])
    assert port.now() - begin < 60


def test_a_sender_whose_session_was_replaced_ends(three_dof: Arm) -> None:
    port = SimPort(SimBoard(BOARDS["uno_cnc_shield"]))
    one = Machine(port, three_dof, configure(three_dof))
    one.prepare()
    port.board.receive(protocol.wire(protocol.hello(0, 0x12345678)))  # another program
    port.board.take()
    with pytest.raises(ReplacedError, match="another program has taken over"):
        one.run([plan_moves(three_dof, one.counts(), np.deg2rad([30, 60, -60]))])


def test_another_version_is_named_with_what_to_flash(three_dof: Arm) -> None:
    port = LyingPort(version=1)
    port.lying = True
    with pytest.raises(LinkError, match=r"protocol 1, this armkin 2: nothing was moved\n.*make -C firmware flash"):
        Machine(port, three_dof, configure(three_dof))
