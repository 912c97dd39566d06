"""`armkin begin`."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.boards.keep_outs import NoScene
from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import Robot, RobotOut, Scene
from armkin.cli.printing import output
from armkin.cli.terminal_keys import Keys, keys
from armkin.errors import ArmkinError, FileError, UsageError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from armkin.board.backend import Backend
    from armkin.board.backend.board import Board
    from armkin.board.commissioning import Findings
    from armkin.model.arm import Arm


def begin(
    robot: Robot,
    port: PortName = None,
    scene: Scene = None,
    no_scene: NoScene = False,
    out: RobotOut = None,
    baud: Baud = None,
    no_reset: NoReset = False,
) -> None:
    """The first hour of an arm on its board, guided.

    Which way each joint turns, where zero is, how far it may go, a first move that comes back home. Before that move a
    joint moves only while a key is held, at a tenth of its speed, 2 degrees or mm where its direction is asked. At the
    end the robot file is corrected, shown as a diff first; --out writes another file instead. With --port sim what an
    imported table does not say of motors is assumed, and named.
    """
    from armkin.board import commissioning
    from armkin.robot_file.catalogue import locate, shipped_file

    keep_outs.check_together(scene, no_scene)
    path = locate(robot)
    if out is None and shipped_file(robot) is not None and path == str(shipped_file(robot)):
        raise UsageError(f"{robot} is a shipped robot, which stays as it is: add --out MINE.yaml")
    if out is not None and Path(out).exists():
        raise FileError(f"{out} is there already; give another name", file=out)
    link = board_link.Link(port, baud, None, resume=False, reset=not no_reset, no_scene=no_scene)
    session = _Session(robot, path, scene, link)
    findings = commissioning.Findings()
    with keys() as person:
        try:
            session.run(findings, person)
        except ArmkinError:
            session.write(findings, out, person)
            raise
        session.write(findings, out, person)
    if findings.at_home is False:
        output.warn(
            "the check was not passed: full_steps, microsteps, gear or pulley of a joint that comes back wrong, "
            "its max_accel, or its motor's current"
        )


class _Session:
    """A robot file on its board, opened again whenever it was corrected."""

    def __init__(self, robot: str, path: str, scene: str | None, link: board_link.Link) -> None:
        self.path, self.scene = path, scene
        self.link, self.port = link, link.port
        arguments.load_arm(robot, scene)  # what is wrong with the files is told first
        self.text = _read_text(path)
        self.assumptions_told = False

    def run(self, findings: Findings, person: Keys) -> None:
        """All steps, in their order."""
        from armkin.board import commissioning

        board, arm = self._corrected_board(findings)
        with self._open(board) as machine:
            self.port = machine.port.name  # the one that was found is asked again
            keep_outs.check_start(machine, arm, self.link.no_scene)
            findings.inverted |= commissioning.directions(board, person)
        board, arm = self._corrected_board(findings)
        with self._open(board):
            findings.zeros = commissioning.zeros(board, person, forget=bool(findings.inverted))
            if not findings.zeros:
                findings.limits = commissioning.limits(board, person)
                findings.at_home = commissioning.first_move(board, person)
                return
        board, arm = self._corrected_board(findings)
        with self._open(board):
            findings.limits = commissioning.limits(board, person)
            findings.at_home = commissioning.first_move(board, person)

    def _open(self, board: Board) -> AbstractContextManager[Backend]:
        return board_link.open_backend(board, self.port, self.link.baud, reset=self.link.reset)

    def _corrected_board(self, findings: Findings) -> tuple[Board, Arm]:
        """The board of the file as it is corrected so far."""
        from armkin.keep_out.load_with_scene import arm_in_scene
        from armkin.robot_file import parse_robot_file
        from armkin.robot_file.scene_file import read_scene

        file = parse_robot_file(self.corrected_text(findings), self.path)
        arm = arm_in_scene(file, None if self.scene is None else read_scene(self.scene))
        if not self.assumptions_told:
            keep_outs.mark_ignored(arm, ignore=False)
        arm = board_link.arm_for_port(arm, self.port, quiet=self.assumptions_told)
        self.assumptions_told = True
        return board_link.board_of(arm, rehearsal=self.port == board_link.SIM), arm

    def corrected_text(self, findings: Findings) -> str:
        """The file's text with what was found."""
        from armkin.robot_file import parse_robot_file
        from armkin.robot_file.replace_values import with_values
        from armkin.robot_file.robot_file_text import flow_text

        file = parse_robot_file(self.text, self.path)
        motors = file.motor_list()
        edits: dict[tuple[str | int, ...], str] = {}
        names = [joint.name for joint in file.joints]
        for k in range(len(motors)):
            keys = ("motors", k) if file.motors else ("joints", names.index(motors[k].name), "drive")
            if k in findings.inverted:
                edits[*keys, "invert"] = flow_text(not motors[k].invert)
            if k in findings.zeros:
                edits[*keys, "zero"] = flow_text(findings.zeros[k])
        for j, pair in findings.limits.items():
            edits["joints", j, "limits"] = flow_text(list(pair))
        return with_values(self.text, edits)

    def write(self, findings: Findings, out: str | None, person: Keys) -> None:
        """The corrected file, shown as a diff and asked for first."""
        from armkin.files import write_whole
        from armkin.robot_file import parse_robot_file

        text = self.corrected_text(findings)
        target = out or self.path
        if text == self.text:
            output.note(f"nothing to correct in {self.path}")
            return
        parse_robot_file(text, target)  # nothing is written that no command would take
        difference = difflib.unified_diff(
            self.text.splitlines(keepends=True), text.splitlines(keepends=True), self.path, target, n=1
        )
        with output.destination(None) as write:
            write("".join(difference))
        if person.ask(f"Write this to {target}? y yes, n no", "yn") == "n":
            output.note("nothing was written")
            return
        if _read_text(self.path) != self.text:
            raise FileError(f"{self.path} has changed meanwhile: nothing was written", file=self.path)
        with write_whole(target, corrects=out is None) as file:
            file.write(text)
        output.note(f"wrote {target}")


def _read_text(path: str) -> str:
    try:
        return Path(path).read_bytes().decode("utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"{path}: cannot read the robot file: {reason}", file=path) from None
