"""Batches by columns: the bytes of CSV, other files, processes, and going on with what is finished."""

import csv
import errno
import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armkin.cli.batches import batch_answers
from armkin.cli.parsing import csv_to_numbers
from armkin.cli.parsing.csv_to_numbers import CsvColumns
from armkin.columns import csv_and_json_lines, finished_chunks, ik_columns
from armkin.columns.csv_cells import csv_line
from armkin.columns.table import Table, Words, take_rows
from armkin.compiled import least_motion as compiled_nearest
from armkin.compiled import table_lines as compiled_text
from armkin.errors import UnfinishedError
from command_line import THREE_DOF, Result, run

ODD = [0.0, -0.0, 1.0, -1.0, 1e-3, 1e-4, 9.9e-5, 1.5e-7, 1e-10, 1e-9, 1e9, 1e10, 1e15, 1e16, 1e17, 1e22, 5e-324, 1e-99]
ODD += [1e-100, 2.5e-100, 1.7976931348623157e308, 0.1, 1 / 3, 123456789.125, 1234567890.5, 9007199254740993.0, np.nan]


def test_a_reader_of_csv_gets_every_word_back() -> None:
    words = ['left, "elbow" up', '"', "a\nb", "c\r\nd", ",", "plain", "", " x ", "'"]
    assert list(csv.reader(io.StringIO(csv_line(words) + "\n", newline=""))) == [words]
    assert csv_line([None, True, False, 2, 1.5]) == ",true,false,2,1.5"


def by_python(table: Table, monkeypatch: pytest.MonkeyPatch) -> tuple[bytes, bytes]:
    monkeypatch.setattr(csv_and_json_lines, "PYARROW_ROWS", 10**9)
    return csv_and_json_lines.to_csv(table), csv_and_json_lines.to_json_lines(table)


@pytest.fixture
def table() -> Table:
    bits = np.random.default_rng(3).integers(0, 2**63, 20_000).view(np.float64)
    values = np.concatenate(
        [ODD, np.negative(ODD), np.round(bits[:2000] % 1000, 3), np.where(np.isfinite(bits), bits, 0.0)]
    )
    words = Words(np.arange(len(values)) % 4 - 1, ("left", 'with, comma and "quote"', "right"))
    return {"row": np.arange(len(values)), "word": words, "value": values, "legal": values > 0}


def test_pyarrow_prints_the_bytes_that_python_prints(table: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    fast = csv_and_json_lines.to_csv(table), csv_and_json_lines.to_json_lines(table)
    assert fast == by_python(table, monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr(csv_and_json_lines, "ROWS", 3_333)
        patch.setattr(csv_and_json_lines, "PYARROW_ROWS", 2_000)
        assert fast == (csv_and_json_lines.to_csv(table), csv_and_json_lines.to_json_lines(table))
    names = ["", 'with, comma and "quote"', "right"]
    assert fast[0].splitlines()[7] == b"7,right,1.5e-07,true"
    assert csv_line([names[1]]).encode() in fast[0]
    json_rows = [json.loads(line) for line in fast[1].splitlines()]
    assert json_rows[0] == {"row": 0, "word": None, "value": 0.0, "legal": False}
    assert json_rows[len(ODD) - 1]["value"] is None


def test_machine_code_prints_the_bytes_that_python_prints(table: Table, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(11)
    doubles = rng.integers(0, 2**64, 40_000, dtype=np.uint64).view(np.float64)
    near = [10.0 ** rng.uniform(-6, 18, 20_000), 2.0 ** np.arange(-1074, 1024), rng.uniform(-400, 400, 20_000).round(3)]
    for values in (doubles, *near):
        float_table: Table = {"row": np.arange(len(values)) - 7, "value": values, "far": -values}
        assert (
            csv_and_json_lines.to_csv(float_table, compiled_text.table_lines) == by_python(float_table, monkeypatch)[0]
        )
    fast = (
        csv_and_json_lines.to_csv(table, compiled_text.table_lines),
        csv_and_json_lines.to_json_lines(table, compiled_text.table_lines),
    )
    assert fast == by_python(table, monkeypatch)
    assert csv_and_json_lines.to_csv(take_rows(float_table, slice(0, 0)), compiled_text.table_lines) == b""
    integers = np.array([0, 9, 10, 99, 100, 2**32 - 1, 2**32, 10**8, 10**16, 2**63 - 1, -(2**63), -10])
    assert csv_and_json_lines.to_csv({"a": integers}, compiled_text.table_lines).decode().split() == list(
        map(str, integers.tolist())
    )


@given(st.lists(st.floats(-1e9, 1e9), min_size=4, max_size=4), st.sampled_from(["%r", " %r", "%.3f", "%.17e"]))
def test_a_number_is_read_as_python_reads_it(row: list[float], form: str) -> None:
    words = [form % value for value in row]
    text = (",".join(words).encode() + b"\n") * 3000
    columns = CsvColumns("abcd", "a test")
    columns.first_row_read = True
    values = columns.all_plain(text)
    assert values is not None
    assert values.tolist() == [[float(word) for word in words]] * 3000


@pytest.fixture
def rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A batch of ten pieces for three_dof; some rows have no branch within limits."""
    monkeypatch.setattr(csv_to_numbers, "CHUNK_ROWS", 30)
    values = np.random.default_rng(2).uniform(-420, 420, (290, 3)).round(3)
    path = tmp_path / "in.csv"
    path.write_text("x,y,z\n" + "\n".join(",".join(map(str, row)) for row in values.tolist()) + "\n")
    return path


def run_ik(source: Path, out: Path, *more: object) -> Result:
    return run("ik", THREE_DOF, "--batch", source, "--out", out, *more)


@pytest.mark.parametrize("more", [[], ["--all-branches"], ["--branch", "left"], ["--near", "10,20,-30"]])
def test_columns_are_what_objects_say(rows: Path, more: list[str]) -> None:
    lines = run("ik", THREE_DOF, "--batch", rows, "--json", *more).lines
    found = run("ik", THREE_DOF, "--batch", rows, *more).out.splitlines()
    expected = []
    for number, answer in enumerate(lines, 2):
        for branch in answer["branches"]:
            measures = [branch[key] for key in ("within_limits", "residual_mm", "residual_deg", "motion")]
            name = branch["name"].replace(",", "")
            expected.append(csv_line([number, answer["status"], name, *branch["joints"], *measures]))
        if not answer["branches"]:
            expected.append(csv_line([number, answer["status"], None, None, None, None, False, None, None, None]))
    assert found[1:] == expected


def test_every_format_holds_the_same_and_is_read_again(rows: Path, tmp_path: Path) -> None:
    outs = {end: tmp_path / f"out.{end}" for end in ("csv", "npz", "parquet", "jsonl")}
    assert {run_ik(rows, out).code for out in outs.values()} == {3}
    csv = [line.split(",") for line in outs["csv"].read_text().splitlines()]
    npz = np.load(outs["npz"])
    parquet = pyarrow.parquet.read_table(outs["parquet"])
    lines = [json.loads(line) for line in outs["jsonl"].read_text().splitlines()]
    assert csv[0] == list(npz) == parquet.column_names == list(lines[0])
    for i, name in enumerate(csv[0]):
        flat = [line[name] for line in lines]
        assert parquet[name].to_pylist() == flat
        cells = ["" if v is None else str(v).lower() if isinstance(v, bool) else str(v) for v in flat]
        assert cells == [row[i] for row in csv[1:]]
        missing = "" if any(isinstance(value, str) for value in flat) else np.nan
        column = [missing if value is None else value for value in flat]
        assert np.array_equal(npz[name], np.array(column), equal_nan=npz[name].dtype.kind == "f")
    again = {end: run("fk", THREE_DOF, "--batch", out).out for end, out in outs.items()}
    assert len(set(again.values())) == 1
    assert len(again["csv"].splitlines()) > 50


def test_json_is_no_archive(rows: Path, tmp_path: Path) -> None:
    for end in ("npz", "parquet"):
        assert run_ik(rows, tmp_path / f"out.{end}", "--json").code == 2


@pytest.mark.parametrize("end", ["csv", "npz", "parquet"])
def test_processes_change_no_byte(rows: Path, tmp_path: Path, end: str) -> None:
    alone, two = tmp_path / f"one.{end}", tmp_path / f"two.{end}"
    assert run_ik(rows, alone) == run_ik(rows, two, "--workers", 2)
    assert alone.read_bytes() == two.read_bytes()


def test_processes_without_rows_leave_nothing(tmp_path: Path) -> None:
    nothing = tmp_path / "nothing.csv"
    nothing.write_text("x,y,z\n")
    for name in (nothing, tmp_path / "missing.csv"):
        assert run_ik(name, tmp_path / "out.csv", "--workers", 2).code in (1, 2)
    assert [path.name for path in tmp_path.iterdir()] == ["nothing.csv"]


def stop_after(pieces: int, monkeypatch: pytest.MonkeyPatch, error: BaseException) -> list[int]:
    """Let a run end when so many pieces are kept; returns the numbers of the pieces that are answered."""
    answered: list[int] = []
    work = batch_answers.answer_piece

    def count_and_call(job: Any, piece: Any) -> Any:
        if len(answered) == pieces:
            raise error
        answered.append(piece.number)
        return work(job, piece)

    monkeypatch.setattr(batch_answers, "answer_piece", count_and_call)
    return answered


@pytest.mark.parametrize("end", ["csv", "npz", "parquet", "jsonl"])
@pytest.mark.parametrize("more", [[], ["--continuous"]])
def test_a_run_goes_on_where_it_was_ended(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, more: list[str]
) -> None:
    undisturbed, target = tmp_path / f"whole.{end}", tmp_path / f"out.{end}"
    completed = run_ik(rows, undisturbed, *more)
    with monkeypatch.context() as patch:
        stop_after(4, patch, KeyboardInterrupt())
        assert run_ik(rows, target, *more).code == 130
    folder = tmp_path / f"out.{end}.parts"
    assert sorted(path.name for path in folder.iterdir() if path.name[0] == "0") == [f"{i:08d}" for i in range(4)]
    (folder / "00000004.writing").write_bytes(b"half")
    refused = run_ik(rows, target, *more)
    assert refused.code == 1
    assert f"out.{end}.parts holds what an earlier run has finished" in refused.err
    answered = stop_after(99, monkeypatch, KeyboardInterrupt())
    assert run_ik(rows, target, *more, "--resume") == completed
    assert answered == [4, 5, 6, 7, 8, 9]
    assert target.read_bytes() == undisturbed.read_bytes()
    assert not folder.exists()


@pytest.mark.parametrize("times", [1, 3])
def test_a_part_that_a_signal_cuts_off_is_swept(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """A signal that came while a part went to the disk left its half beside the finished ones."""
    written: list[int] = []

    def interrupt(descriptor: int) -> None:
        written.append(descriptor)
        if len(written) == 2 + times:  # after the job and the parts before
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    assert run_ik(rows, tmp_path / "out.csv").code == 130
    left = sorted(path.name for path in (tmp_path / "out.csv.parts").iterdir())
    assert left == [*(f"{number:08d}" for number in range(times)), "job.json", "lock"]


def test_another_job_is_refused_and_loses_nothing(rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out.csv"
    with monkeypatch.context() as patch:
        stop_after(4, patch, KeyboardInterrupt())
        run_ik(rows, out)
    before = rows.read_bytes()
    for more, word in ((["--all-branches"], "all_branches"), (["--near", "1,2,3"], "near")):
        refused = run_ik(rows, out, *more, "--resume")
        assert refused.code == 2
        assert f"belongs to another job: {word} differs" in refused.err
    rows.write_bytes(before + b"1,2,3\n")
    assert "input size differs" in run_ik(rows, out, "--resume").err
    rows.write_bytes(before.replace(b"x,y,z", b"x,Y,z"))  # as long, in the first piece
    assert "the input has changed" in run_ik(rows, out, "--resume").err
    rows.write_bytes(before)
    assert run_ik(rows, out, "--resume").code == 3


def test_a_changed_robot_is_refused_and_loses_nothing(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, out = tmp_path / "arm.yaml", tmp_path / "out.csv"
    text = Path(THREE_DOF).read_text()
    robot.write_text(text)
    with monkeypatch.context() as patch:
        stop_after(4, patch, KeyboardInterrupt())
        run("ik", robot, "--batch", rows, "--out", out)
    robot.write_text(text.replace("a: 197", "a: 198"))
    refused = run("ik", robot, "--batch", rows, "--out", out, "--resume")
    assert refused.code == 2
    assert "belongs to another job: robot" in refused.err
    robot.write_text(text)
    assert run("ik", robot, "--batch", rows, "--out", out, "--resume").code == 3


def test_two_runs_do_not_share_a_folder(rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out.csv"
    with monkeypatch.context() as patch:
        stop_after(4, patch, KeyboardInterrupt())
        run_ik(rows, out)
    job = json.loads((tmp_path / "out.csv.parts" / "job.json").read_text())
    second_run = finished_chunks.Parts(str(out), job)
    second_run.begin()
    assert "another run works on it" in run_ik(rows, out, "--resume").err
    second_run.leave()
    assert run_ik(rows, out, "--resume").code == 3


def test_a_full_disk_stops_and_the_run_goes_on_later(
    rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    undisturbed, out = tmp_path / "whole.csv", tmp_path / "out.csv"
    run_ik(rows, undisturbed)
    flush = os.fsync
    calls: list[int] = []

    def full(number: int) -> None:
        calls.append(number)
        if len(calls) == 5:
            raise OSError(errno.ENOSPC, "No space left on device")
        flush(number)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        stopped = run_ik(rows, out)
    assert stopped.code == 1
    assert "the disk is full; what is finished stays in" in stopped.err
    assert "--resume" in stopped.err
    assert run_ik(rows, out, "--resume").code == 3
    assert out.read_bytes() == undisturbed.read_bytes()


def test_resume_belongs_to_a_file(rows: Path) -> None:
    assert run("ik", THREE_DOF, "--batch", rows, "--resume").code == 2
    assert run("fk", THREE_DOF, 1, 2, 3, "--resume").code == 2


def test_bad_archives_are_told(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", x=np.zeros(3), y=np.zeros(2), z=np.zeros(3))
    np.savez(tmp_path / "b.npz", x=np.zeros(3), y=np.zeros(3))
    np.savez(tmp_path / "c.npz", x=np.zeros(3), y=np.zeros(3), z=np.array([0, np.inf, 0]))
    np.savez(tmp_path / "d.npz", x=np.zeros(3), y=np.zeros(3), z=np.array(["a", "b", "c"]))
    (tmp_path / "e.npz").write_bytes(b"no archive")
    (tmp_path / "f.parquet").write_bytes(b"no table")
    (tmp_path / "g.jsonl").write_text('{"x": 1, "y": "two", "z": 3}\n')
    for name, message in (
        ("a.npz", "not of one length"),
        ("b.npz", "has no column z"),
        ("c.npz", "row 2: z: inf is too large"),
        ("d.npz", "z is no column of numbers"),
        ("e.npz", "cannot read"),
        ("f.parquet", "cannot read"),
        ("g.jsonl", 'row 1: y: "two" is no number'),
        ("h.npz", "cannot read"),
    ):
        completed = run("ik", THREE_DOF, "--batch", tmp_path / name)
        assert completed.code in (1, 2), name
        assert message in completed.err, completed.err


def test_the_error_of_unfinished_parts_has_its_fields(tmp_path: Path) -> None:
    (tmp_path / "out.csv.parts").mkdir()
    with pytest.raises(UnfinishedError) as caught:
        finished_chunks.Parts(str(tmp_path / "out.csv"), {}).refuse_begun()
    assert caught.value.fields["parts"] == str(tmp_path / "out.csv.parts")


def test_machine_code_takes_the_same_branch() -> None:
    rng = np.random.default_rng(4)
    for N, B, n in ((3_000, 8, 6), (500, 1, 3), (400, 5, 7), (20, 0, 6), (0, 8, 6)):
        near, scale = rng.uniform(-1.0, 1.0, n), np.where(rng.random(n) < 0.3, 1.0, np.pi / 180)
        q, is_valid = rng.uniform(-3.0, 3.0, (N, B, n)), rng.random((N, B)) < 0.6
        if B > 2:  # as far as another one, but for rounding
            q[::3, 1] = 2.0 * near - q[::3, 0] + 1e-12
        q[~is_valid] = np.nan
        python, fast = (
            ik_columns.nearest_branches(q, is_valid, near, scale),
            compiled_nearest.nearest_branches(q, is_valid, near, scale),
        )
        assert fast is not None
        assert (fast[0] == python[0]).all()
        assert (fast[1] == python[1])[python[0] >= 0].all()
    assert (
        compiled_nearest.nearest_branches(np.zeros((1, 1, 8)), np.ones((1, 1), bool), np.zeros(8), np.ones(8)) is None
    )
