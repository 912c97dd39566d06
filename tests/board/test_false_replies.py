"""Boards that say what cannot be, stand still or are taken over: senders end in bounded time, never with success."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armkin.board.firmware import gripping, homing, jogging
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Info, Status
from armkin.board.firmware.wire.reply_checks import BoardSaysError, ReplacedError
from armkin.board.kinds.firmware import Switches
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort
from armkin.board_catalogue import BOARDS
from armkin.errors import LinkError
from armkin.model import build_arm as arms
from armkin.model.arm import Arm
from armkin.motion.rounded_waypoints import round_waypoints
from armkin.robot_file import parse_robot_file


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return arms.load_arm("robots/three_dof.yaml")


class LyingPort(SimPort):
    """A simulated board whose replies are changed on their way, once `lying`."""

    def __init__(self, switches: Switches | None = None, **lies: int | tuple[int, ...]) -> None:
        super().__init__(SimBoard(BOARDS["uno_cnc_shield"], switches))
        self.simulated, self.lying, self._lies = False, False, lies
        self._splitter = protocol.Splitter()

    def read(self, timeout: float) -> bytes:
        data = super().read(timeout)
        return b"".join(self._changed(payload) for payload in self._splitter.feed(data))

    def _changed(self, payload: bytes) -> bytes:
        reply = protocol.parse_reply(payload)
        assert reply is not None
        if self.lying:
            reply = replace(reply, **{k: v for k, v in self._lies.items() if hasattr(reply, k)})  # type: ignore[arg-type]
        pack = {Info: protocol.pack_info, Status: protocol.pack_status}.get(type(reply), protocol.pack_ack)
        return protocol.encode_frame(pack(reply))  # type: ignore[operator]


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
    port = LyingPort(None, **lie)
    port.lying = True
    with pytest.raises(BoardSaysError, match=f"answers {next(iter(lie))} "):
        FirmwareMachine(port, three_dof, configure(three_dof))


# What replies are made to say once the machine is ready.
LIES: list[dict[str, Any]] = [
    *({"state": value} for value in (1, 2, 3, 5, 6, 17, 128, 255)),  # never comes to rest, or no state at all
    *({"error": value} for value in (1, 2, 8, 9, 20, 21, 22, 23, 24, 30, 31, 32, 33, 64, 255)),
    *({"free": value} for value in (0, 33, 40, 64, 128, 255)),  # never takes more, or has more than there are
    *({"next": value} for value in (0, 100, 200, 250, 255)),  # never goes on, or ahead of what was sent
    *({"counts": value} for value in ((), (0,), (0, 0, 0), (0,) * 4, (0,) * 6, (0,) * 15)),
    *({"counts": (value,) * 5} for value in (1, -1, 12345, 2**30, 2**31 - 1, -(2**31))),  # stands elsewhere
    *({"known": value} for value in (0, 0xE0, 0x100, 0xFFFF)),
    *({"session": value} for value in (1, 2, 0x7FFF, 0xFFFF)),
    *({"overruns": value} for value in (1, 3, 255)),
    *({"state": 1, "queued": value} for value in (0, 1, 65535)),
    *({"state": 0, "error": value} for value in (3, 4, 5, 12, 13, 16, 29)),
    *({"state": 4, "free": value} for value in (0, 32)),
    *({"state": 2, "next": value} for value in (0, 3)),
    *({"page": value} for value in (2, 255)),
    *({"known": 0, "state": value} for value in (0, 1, 5)),
    *({"flags": 0, "error": value} for value in (11, 20, 30)),
    *({"free": 0, "next": value} for value in (0, 7)),
    *({"session": 1, "state": value} for value in (0, 1)),
    *({"error": 25, "state": value} for value in (0, 3)),
    *({"error": 26, "detail": value} for value in (0, 255)),
    *({"tag": value} for value in (0, 77, 255)),  # answers to questions that nobody asked
]
CORNERS = np.deg2rad([[20, 80, -90], [20, 60, -70], [0, 70, -80]])
GOAL = np.deg2rad([30, 60, -60])
LONG = "ARMKIN_LONG" in os.environ  # all 90 for all commands: five minutes
# A jog ends where the board says, and needs no credit; homing takes its position from what the board counts, and its
# caller asks for `lost_joints`. A wrong tag alone misleads nobody: a gripper needs no answer to a question of its own,
# and while a joint jogs every tag is asked with once.
CANNOT_KNOW = {
    "jog": {"counts", "known", "free", "state", "tag"},
    "home": {"counts", "free", "known"},
    "grip": {"tag"},
}
COMMANDS: dict[str, Callable[[FirmwareMachine], object]] = {
    "send": lambda one: one.run([one.plan(one.counts(), GOAL)]),
    "batch": lambda one: one.run([one.plan(one.counts(), np.stack([GOAL, GOAL / 2, GOAL]))]),
    "curve": lambda one: one.run(
        [one.plan_trajectory(round_waypoints(one.arm, one.joints(), CORNERS, 10.0), np.array(one.counts()))]
    ),
    "grip": lambda one: gripping.move_gripper(one, gripping.gripper_of("arm", one.configuration), 1500),
    "home": lambda one: homing.home_joints(one),
    "jog": lambda one: jogging.jog_motors(one, jogging.count_rates(one, 0, 10.0), 0.3),
}


@pytest.fixture(scope="module")
def arm_with_switches() -> Arm:
    """With a limit switch on every joint, beside its home pose."""
    text = Path("robots/three_dof.yaml").read_text()
    for axis, switch_value in zip("XYZ", (-20, 75, -105), strict=True):
        homing = f"homing: {{switch: {axis}, direction: -1, at: {switch_value}, speed: 40, backoff: 3, normally: open}}"
        text = text.replace(f"    drive: {{axis: {axis},", f"    {homing}\n    drive: {{axis: {axis},")
    return arms.arm_of_file(parse_robot_file(text))


@pytest.mark.parametrize("command", COMMANDS)
def test_lies_to_a_moving_command_end_it_in_bounded_time(arm_with_switches: Arm, command: str) -> None:
    """Never an internal error, never without an end; with success only where the command cannot know better."""
    believed = []
    for lie in LIES if LONG else LIES[:: 5 if command == "send" else 8]:
        configuration = configure(arm_with_switches)
        port = LyingPort(homing.switch_levels(arm_with_switches, configuration), **lie)
        machine = FirmwareMachine(port, arm_with_switches, configuration)
        machine.prepare(assume=arm_with_switches.home)
        gripping.prepare_gripper(machine, gripping.gripper_of("arm", configuration), 833)
        port.lying = True
        begin = port.now()
        try:
            COMMANDS[command](machine)
            believed.append(lie)
        except LinkError:
            pass
        assert port.now() - begin < 120, lie
    assert not [lie for lie in believed if not set(lie) <= CANNOT_KNOW.get(command, set())]


def test_a_sender_whose_session_was_replaced_ends(three_dof: Arm) -> None:
    port = SimPort(SimBoard(BOARDS["uno_cnc_shield"]))
    machine = FirmwareMachine(port, three_dof, configure(three_dof))
    machine.prepare()
    port.board.receive(protocol.encode_frame(protocol.hello(0, 0x12345678)))  # another program
    port.board.take()
    with pytest.raises(ReplacedError, match="another program has taken over"):
        machine.run([plan_moves(three_dof, machine.counts(), np.deg2rad([30, 60, -60]))])


def test_another_version_is_named_with_what_to_flash(three_dof: Arm) -> None:
    port = LyingPort(version=1)
    port.lying = True
    with pytest.raises(LinkError, match=r"protocol 1, this armkin 2: nothing was moved\n.*make -C firmware flash"):
        FirmwareMachine(port, three_dof, configure(three_dof))
