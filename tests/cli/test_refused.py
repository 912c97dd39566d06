"""What has no sensible meaning is refused at once: in a line or two, with what is allowed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.firmware.wire.session import Session
from armkin.errors import LinkError, PathFileError, UsageError
from armkin.motion.joint_moves import check_rates
from command_line import THREE_DOF, run

DOF = THREE_DOF
LINE = "start: {point: [390, 80, 300]}\nmoves: [{line: [390, -80, 300]}]\n"


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("tool_speed: 1.0e-300", "path.yaml:1: tool_speed: must be at least 0.001, not 1e-300"),
        ("tool_speed: 1.0e-6", "tool_speed: must be at least 0.001"),
        ("tolerance: 1.0e-300", "tolerance: must be at least 1e-06"),
        ("speed: 1.0e-300", "speed: must be at least 0.01"),
        ("tool_speed: 0.001", "the motion takes 160326 s; one plan lasts a day (86400 s) at most: go faster"),
    ],
)
def test_a_path_has_least_speeds_and_a_least_tolerance(key: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "path.yaml"
    file.write_text(f"{key}\n{LINE}")
    completed = run("path", DOF, file)
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err
    assert completed.err.count("\n") == 1


def test_a_table_of_corners_has_the_same_least_speed(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("x,y,z,tool_speed\n390,80,300,1\n390,-80,300,1e-300\n")
    completed = run("path", DOF, file)
    assert (completed.code, completed.out) == (2, "")
    assert "path.csv:3: blend is at least 0, tool_speed at least 0.001 mm/s" in completed.err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (f"send {DOF} 0 80 -90 --port sim --speed 1e-300", "--speed: '1e-300' must be from 0.01 to 100 percent"),
        (f"send {DOF} 0 80 -90 --port sim --speed 1e-5", "from 0.01 to 100 percent"),
        (f"send {DOF} 0 80 -90 --dry-run --speed 0", "from 0.01 to 100 percent"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --speed 0.001", "--speed: '0.001' must be from 0.01"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --accel 101", "--accel: '101' must be from 0.01"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --tool-speed 1e-6", "must be at least 0.001"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --tolerance 1e-300", "must be at least 1e-06"),
        (f"workspace {DOF} --samples 99999999999999", "must be a whole number from 1 to 10000000000"),
        (f"workspace {DOF} --grid 99999,99999,99999", "999,970,000,299,999 points; 10,000,000,000 at most"),
        ("ik iiwa7 500 0 500 180 0 0 --sweep J3", "--sweep J3: write JOINT=LOW:HIGH:COUNT, for example J3=-90:90:16"),
        (f"ik {DOF} 390 80 300 --sweep q1=0:10:99999999999", "'99999999999' must be a whole number from 1 to 10000"),
        (f"ik {DOF} 390 80 300 --sweep q1=0:10:1e999", "'1e999' must be a whole number from 1 to 10000"),
    ],
)
def test_a_number_without_sense_is_refused_with_what_is_allowed(line: str, says: str) -> None:
    completed = run(*line.split())
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err
    assert completed.err.count("\n") == 1


def test_programs_are_refused_the_same() -> None:
    arm = armkin.load(DOF)
    corners = [[390, 80, 300], [390, -80, 300]]
    several: list[dict[str, Any]] = [
        {"speed": 1e-300},
        {"accel": 1e-300},
        {"tool_speed": 1e-300},
        {"tolerance": 1e-300},
    ]
    for bad in several:
        with pytest.raises(UsageError, match="is not possible"):
            armkin.path(arm, corners, **bad)
    with pytest.raises(PathFileError, match=r"tool_speed: must be at least 0\.001"):
        armkin.path(arm, {"moves": [{"point": corners[0]}, {"line": corners[1], "tool_speed": 1e-9}]})


def test_a_speed_below_one_percent_is_noted_and_taken() -> None:
    completed = run("send", DOF, 0, 89, -90, "--dry-run", "--speed", 0.5)
    assert completed.code == 0
    assert "note: --speed 0.5: 0.5 percent; half is --speed 50" in completed.err
    assert run("send", DOF, 0, 89, -90, "--dry-run", "--speed", 1).err == ""


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("stop", "three_dof", "--port", "sim"), 2, "stop takes no robot"),
        (("status", DOF, "--port", "sim", "--baud", "0"), 2, "--baud: '0' must be a whole number from 1 to 4000000"),
        (("status", DOF, "--port", "sim", "--baud", "-5"), 2, "--baud: '-5' must be"),
        (("stop", "--port", "/no", "--baud", "4000001"), 2, "from 1 to 4000000"),
        (("status", DOF, "--port", "sim", "--baud", "abc"), 2, "--baud: 'abc' is not a number"),
        (("status", DOF, "--port", "socket://"), 5, "write socket://HOST:NUMBER, for example"),
        (("status", DOF, "--port", "socket://host:99999"), 5, "(1 to 65535)"),
        (("status", DOF, "--port", "rfc2217://host"), 5, "write rfc2217://HOST:NUMBER"),
        (("status", DOF, "--port", ""), 5, "the port's name is empty"),
        (("info", "a\nb"), 1, "a\\nb"),
        (("fk", "a\r\nb", "1"), 1, "a\\r\\nb"),
        (("new", "x\ny", "--dh", "0,1,2", "--convention", "standard"), 2, "x\\ny"),
        (("status", DOF, "--port", "/no/a\nb"), 5, "/no/a\\nb"),
        (("status", DOF, "--port=/no/a\nb"), 5, "/no/a\\nb"),
        (("f\nk",), 2, "there is no command 'f\\nk'"),
    ],
)
def test_a_word_without_sense_is_told_in_its_own_words(words: tuple[str, ...], code: int, says: str) -> None:
    completed = run(*words)
    assert (completed.code, completed.out) == (code, "")
    assert says in completed.err
    assert completed.err.count("\n") <= 1 + completed.err.count("--help")


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ('"1,2,3\n', "leave quotes out"),
        ('"1,2,3"\n', "leave quotes out"),
        ("q1,q1,q3\n1,2,3\n", "the heading has two columns q1"),
        ("x,y,z\n390,80,300\n", "armkin ik ROBOT --batch FILE"),
    ],
)
def test_a_row_without_sense_has_the_right_hint(rows: str, says: str) -> None:
    completed = run("send", DOF, "--batch", "-", "--dry-run", stdin=rows.encode())
    assert completed.code == 2
    assert says in completed.err


def test_targets_in_a_file_are_solved_and_sent() -> None:
    solved = run("ik", DOF, "--batch", "-", "--continuous", stdin=b"x,y,z\n390,80,300\n390,-80,300\n")
    sent = run("send", DOF, "--batch", "-", "--dry-run", stdin=solved.out.encode())
    assert sent.code == 0, sent.err
    assert "2 waypoints" in sent.out


@pytest.mark.parametrize("name", ["true", "123", "null"])
def test_any_name_of_an_arm_is_text(name: str, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    completed = run("new", name, "--dh", "90,0,170", "--convention", "standard", "-o", file)
    assert completed.code == 0, completed.err
    assert armkin.load(str(file)).name == name


def test_rates_that_are_missing_are_them() -> None:
    arm = armkin.load("ur5e")
    bare = replace(arm, max_speed=np.full(arm.n, np.nan), max_accel=np.full(arm.n, np.nan))
    with pytest.raises(UsageError, match="motion needs them; add"):
        check_rates(bare)


class Talker:
    """A port where something else talks."""

    name, baud, simulated = "COM9", 250_000, True

    def __init__(self, reply: bytes) -> None:
        self.said, self.time = reply, 0.0

    def now(self) -> float:
        return self.time

    def read(self, timeout: float) -> bytes:
        self.time += timeout
        return self.said

    def write(self, data: bytes) -> None:
        del data

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("reply", "says"),
    [
        (b"", "no board answers on COM9 (250000 baud): is"),
        (b"junk\0\1\2", "something answers on COM9 (250000 baud), but not in this protocol: is"),
        (
            b"\r\nGrbl 1.1h ['$' for help]\r\n",
            "GRBL answers on COM9 (250000 baud): its robot file says board: {kind: grbl}",
        ),
    ],
)
def test_what_does_not_speak_the_protocol_is_told_apart(reply: bytes, says: str) -> None:
    with pytest.raises(LinkError) as caught:
        Session(Talker(reply)).open()
    assert says in str(caught.value)


def test_a_stream_that_moves_nothing_prints_nothing() -> None:
    for data in (b"", b"x\n", b"0,130,0\n"):
        completed = run("send", THREE_DOF, "--batch", "-", "--port", "sim", stdin=data)
        assert completed.out == "", data
        assert completed.code == (3 if b"130" in data else 2)


def test_counts_of_one_are_said_so(tmp_path: Path) -> None:
    assert "1 row is too few" in run("calibrate", THREE_DOF, "-", stdin=b"1,2,3,4,5,6\n").err
    file = tmp_path / "g.yaml"
    file.write_text("moves: []\n")
    assert "moves: has 0 items, and must have at least 1" in run("path", THREE_DOF, file).err
    assert (
        "does not fit the 2 joints that are not held; hold fewer joints"
        in run("ik", THREE_DOF, 390, 80, 300, "--lock", "q1=5").err
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("moves: [{wait: -1}]", "move 1: wait: must be at least 0, not -1"),
        ("moves: [{wait: abc}]", "move 1: wait: is the text 'abc'; for example wait: 0.5"),
        ("moves: [{grip: half}]", "move 1: grip: is the text 'half'; for example grip: closed"),
        (f"corners: round\n{LINE}", "corners: is the text 'round'; for example corners: stop, corners: blend or"),
        ("moves:\n  - 5\n", "move 1: is 5; for example moves: [{line: [390, 160, 300]}, {wait: 1}]"),
        ("moves: home\n", "moves: is the text 'home'; for example moves: [{line:"),
        (f"robot: 5\n{LINE}", "robot: is 5; for example robot: three_dof"),
        ("start: [0, 90, -90]\nmoves: [{wait: 1}]", "start: is a list; for example start: home, start: {joints:"),
        ("start: {}\nmoves: [{wait: 1}]", "start: give joints: or point:, one of them"),
        ("start: {joints: home, point: [390, 80, 300]}\nmoves: [{wait: 1}]", "start: give joints: or point:, one of"),
    ],
)
def test_a_wrong_value_in_a_path_is_told_in_the_file_s_own_words(text: str, says: str) -> None:
    completed = run("path", DOF, "-", stdin=text.encode())
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err
    assert "input should" not in completed.err


@pytest.mark.parametrize(
    ("words", "stdin", "says"),
    [
        (("home", DOF, "--port", "sim", "--assume-home"), b"", "no such option: --assume-home"),
        (("fk", DOF, 1, 2, 3, "--assume-home"), b"", "no such option: --assume-home"),
        (
            ("fk", DOF, "--batch", "-"),
            b'0,90,"-90\n1,2,3\n',
            "row 1: this is no CSV of numbers: its quotes do not match",
        ),
        (("fk", DOF, "--batch", "-"), b"q1,q2,q3\n", "has no row with values"),
        (("import", "-"), b"", "is empty"),
        (("ik", "iiwa7", 400, 0, 500, 180, 0, 0, "--sweep", "J3=-10:10:3"), b"", "with J3 free the nearest pose"),
    ],
)
def test_the_message_is_of_what_was_typed(words: tuple[Any, ...], stdin: bytes, says: str) -> None:
    completed = run(*words, stdin=stdin)
    assert (completed.code in (1, 2, 3, 4), completed.err.count("\n") <= 3) == (True, True)
    assert says in completed.err


def test_quoted_cells_with_blanks_beside_the_comma_are_read() -> None:
    rows = b'"q1" , "q2", "q3"\n"10" ,"20" , "30"\n'
    assert run("fk", DOF, "--batch", "-", stdin=rows).out.splitlines()[1].startswith("10.0,20.0,30.0,")


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ('{"q1": 1, "q2": 2, "q3": 3, "q1": 9}', "row 1: it has q1 twice"),
        ('{"q1": 1, "q2": 2, "q3": NaN}', "row 1: q3: nan is not finite"),
        ('{"q1": 1, "q2": -Infinity, "q3": 3}', "row 1: q2: -inf is not finite"),
        (f'{{"q1": 1{"0" * 400}, "q2": 2, "q3": 3}}', "row 1: q1: a number of 401 digits is too large"),
        ("[1, 2, 3]", "row 1: this is no JSON object"),
    ],
)
def test_a_row_of_json_lines_is_as_strict_as_one_of_csv(row: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    file.write_text(f"{row}\n")
    completed = run("fk", DOF, "--batch", file)
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err
    file.write_bytes(b'\xef\xbb\xbf{"q1": 1, "q2": 2, "q3": 3}\n')
    assert run("fk", DOF, "--batch", file).code == 0
