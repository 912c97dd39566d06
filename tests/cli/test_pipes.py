"""One command's output is the next one's input: JSON as it is, CSV by the names in its heading."""

import csv
import io
from pathlib import Path

import pytest

from command_line import THREE_DOF, Result, run

TARGETS = b"x,y,z\n390,80,300\n9000,0,0\n0,400,200\n"
ANSWER = run("fk", THREE_DOF, 1, 2, 3, "--json").out.encode()


def run_piped(first: Result, *words: object) -> Result:
    return run(*words, stdin=first.out.encode())


def test_json_of_ik_goes_into_fk_and_pulses() -> None:
    answer = run("ik", THREE_DOF, 390, 80, 300, "--json")
    best = answer.json["branches"][0]["joints"]
    for robot in ([], [THREE_DOF], ["three_dof"]):
        assert run_piped(answer, "fk", *robot, "--json").json["joints"] == best
        assert run_piped(answer, "pulses", *robot, "--json").json["joints"] == best
    assert run_piped(answer, "fk", "--json").json["position_mm"] == pytest.approx([390, 80, 300])
    assert run_piped(run_piped(answer, "fk", "--json"), "pulses", "--json").json["joints"] == best
    assert "390.0000" in run_piped(answer, "fk").out


def test_json_lines_are_a_batch_and_unsolved_answers_are_skipped() -> None:
    answers = run("ik", THREE_DOF, "--batch", "-", "--json", stdin=TARGETS)
    completed = run_piped(answers, "fk")
    assert completed.code == 0
    assert len(completed.out.splitlines()) == 3
    assert completed.err == "warning: 1 of 3 answers have no branch within limits: skipped\n"
    assert [line["robot"] for line in run_piped(answers, "pulses", "--json").lines] == ["three_dof"] * 2
    none = run_piped(run("ik", THREE_DOF, 9000, 0, 0, "--json"), "fk")
    assert (none.code, none.out) == (3, "")


@pytest.mark.parametrize(
    ("words", "stdin", "code", "says"),
    [
        (("fk",), b"", 2, "missing argument 'ROBOT'"),
        (("fk", THREE_DOF), b"", 2, "three_dof takes 3 numbers"),
        (("fk", THREE_DOF), b"1,2,3\n", 2, "for rows of CSV add --batch -"),
        (("fk",), b"1,2,3\n", 2, "no JSON: give --json"),
        (("pulses",), b"{}", 2, "it has no robot_file"),
        (("fk", "ur5e"), ANSWER, 1, "is of three_dof, and the command is for ur5e"),
        (("fk", THREE_DOF), ANSWER.replace(b'_sha256": "', b'_sha256": "0'), 1, "computed with another"),
        (("fk", "--batch", "-"), b"1,2,3\n", 2, "missing argument 'ROBOT'"),
    ],
)
def test_what_is_no_answer_is_refused(words: tuple[str, ...], stdin: bytes, code: int, says: str) -> None:
    completed = run(*words, stdin=stdin)
    assert (completed.code, completed.out) == (code, "")
    assert says in completed.err


def test_csv_of_ik_goes_into_fk_and_pulses() -> None:
    solved = run("ik", THREE_DOF, "--batch", "-", stdin=TARGETS)
    assert solved.code == 3
    completed = run_piped(solved, "fk", THREE_DOF, "--batch", "-", "--json")
    assert [line["position_mm"] for line in completed.lines] == [
        pytest.approx([390, 80, 300]),
        pytest.approx([0, 400, 200]),
    ]
    assert completed.err == "warning: 1 row without q1,q2,q3 skipped\n"
    back = run_piped(run_piped(solved, "fk", THREE_DOF, "--batch", "-"), "ik", THREE_DOF, "--batch", "-", "--json")
    assert [line["target"] for line in back.lines] == [pytest.approx([390, 80, 300]), pytest.approx([0, 400, 200])]
    assert run_piped(solved, "pulses", THREE_DOF, "--batch", "-").code == 0


def test_a_branch_is_one_column_for_cut() -> None:
    solved = run("ik", THREE_DOF, "--batch", "-", "--all-branches", stdin=b"390,80,300\n")
    cells = [line.split(",") for line in solved.out.splitlines()]
    assert {len(row) for row in cells} == {len(cells[0])}
    name = cells[1][cells[0].index("branch")]
    assert name == "left elbow up"
    again = run("ik", THREE_DOF, 390, 80, 300, "--branch", name, "--json").json
    assert again["branches"][0]["joints"] == [float(cell) for cell in cells[1][3:6]]


def test_a_trace_goes_into_fk_and_ik() -> None:
    trace = run("send", THREE_DOF, -30, 5, -5, "--dry-run", "--trace", "-")
    assert trace.code == 0
    assert "dry run" in trace.err
    table = list(csv.DictReader(io.StringIO(trace.out)))
    tips = [[float(row[f"tool_{axis}_mm"]) for axis in "xyz"] for row in table]
    poses = run_piped(trace, "fk", THREE_DOF, "--batch", "-", "--json").lines
    assert len(poses) == len(table) > 100
    assert [pose["position_mm"] for pose in poses] == [pytest.approx(point, abs=1e-9) for point in tips]
    targets = run_piped(trace, "ik", THREE_DOF, "--batch", "-", "--json").lines
    assert [answer["target"] for answer in targets] == tips


@pytest.mark.parametrize(
    ("text", "joints"),
    [
        (b"q3,q1,q2\n3,1,2\n", [1, 2, 3]),
        (b'\n# made by hand\nq3 , Q1,note,q2\n3,1,"a, b",2\n', [1, 2, 3]),
        (b"time_s,q1/deg,q2_deg,q3,tool_x_mm\n0,1,2,3,9\n", [1, 2, 3]),
        (b"home\n", [0, 90, -90]),
        (b'"q1","q2","q3"\n"1","2","3"\n', [1, 2, 3]),
    ],
)
def test_columns_go_by_their_names(text: bytes, joints: list[float]) -> None:
    assert [line["joints"] for line in run("fk", THREE_DOF, "--batch", "-", "--json", stdin=text).lines] == [joints]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"q1,q2\n1,2\n", "row 1: the heading has no column q3; it has q1, q2"),
        (b"a,b,c\n1,2,3\n", "row 1: a heading without the columns q1, q2, q3"),
        (b"q1,q2,q3,q1\n1,2,3,4\n", "row 1: the heading has two columns q1"),
        (b"q1,q2,q3,n\n1,2,3\n", "row 2: has 3 cells, the heading has 4"),
        (b"q1,q2,q3,n\n1,x,3,4\n", "row 2: q2: 'x' is not a number"),
        (b"q1,q2,q3,n\n,,,4\n", "has no row with values"),
    ],
)
def test_a_heading_that_does_not_fit_is_told(text: bytes, says: str) -> None:
    completed = run("fk", THREE_DOF, "--batch", "-", "--json", stdin=text)
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err


def test_a_heading_costs_no_speed() -> None:
    """A long file with text columns is read in one go, like one of plain numbers."""
    rows = b"note,q3,q2,q1\n" + b"left elbow up,3,2,1\n" * 9000
    completed = run("fk", THREE_DOF, "--batch", "-", stdin=rows)
    plain = run("fk", THREE_DOF, "--batch", "-", stdin=b"1,2,3\n" * 9000)
    assert completed == plain


def test_send_takes_poses_and_named_columns(tmp_path: Path) -> None:
    text = b"note,q3,q1,q2\na,-90,10,90\nb,-80,0,80\n"
    path = tmp_path / "rows.csv"
    path.write_bytes(text)
    for source in ("-", path):
        completed = run("send", THREE_DOF, "--batch", source, "--port", "sim", "--json", stdin=text)
        assert completed.json["waypoints"] == 2
        assert completed.json["joints"] == pytest.approx([0, 80, -80], abs=0.02)
    assert run("send", THREE_DOF, "--batch", "-", "--dry-run", "--json", stdin=b"home\n").json["waypoints"] == 1
