"""Words on the command line: numbers, negative ones above all, and options."""

import pytest

from armkin.cli.parsing.negative_numbers import options_first
from armkin.cli.parsing.number_parsing import comma_separated, number, numbers, whole_number
from armkin.errors import UsageError
from command_line import THREE_DOF, run


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5", 5),
        ("-5", -5),
        ("+5", 5),
        ("-.5", -0.5),
        ("5.", 5),
        ("1e3", 1000),
        ("1E-3", 0.001),
        ("-0", 0),
        (" 7 ", 7),
        ("\u22127.5", -7.5),  # the minus sign of printed papers
        ("007", 7),
        ("0." + "3" * 400, 1 / 3),
        ("1e-400", 0),
    ],
)
def test_numbers(text: str, value: float) -> None:
    assert number(text, "q1") == pytest.approx(value, abs=0)


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", ";", "-", "+", ".", "e5", "5x", "-5x", "nan", "-nan", "inf", "-Infinity", "1_000", "0x10"),
        *("1e999", "9" * 400, "1e10", "1,5", "5,", "5mm", "30 deg", "30\u00b0", "1 2", "--5", "1e", "None"),
        *("\u0663", "\0"),
    ],
)
def test_not_numbers(text: str) -> None:
    with pytest.raises(UsageError, match=r"^q1: "):
        number(text, "q1")


def test_hints() -> None:
    for text, hint in {
        "30deg": "write 30",
        "1,5": "write 1.5",
        "5,": "write 5",
        "nan": "not finite",
        "1e10": "too large",
    }.items():
        with pytest.raises(UsageError, match=hint):
            number(text, "q1")


def test_counts() -> None:
    assert numbers(["1", "2"], ["x", "y"], "xy") == [1, 2]
    assert comma_separated("0, 90,-90", ["a", "b", "c"], "--near") == [0, 90, -90]
    with pytest.raises(UsageError, match=r"xy takes 2 numbers \(x y\), got 3"):
        numbers(["1", "2", "3"], ["x", "y"], "xy")
    with pytest.raises(UsageError, match="with commas: 0,90"):
        comma_separated("0 90", ["a", "b"], "--near")
    assert whole_number("1e2", "count", 1, 100) == 100
    for text in ("1.5", "0", "101"):
        with pytest.raises(UsageError, match="whole number from 1 to 100"):
            whole_number(text, "count", 1, 100)
    assert whole_number("2e9", "--samples", 1, 10**15) == 2_000_000_000
    with pytest.raises(UsageError, match="from 1 to 1000000000000000"):
        whole_number("1e18", "--samples", 1, 10**15)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["a", "-1", "-.5", "-2e3"], ["--", "a", "-1", "-.5", "-2e3"]),
        (["-1", "--json", "-2"], ["--json", "--", "-1", "-2"]),
        (["--near", "-1,2", "-3"], ["--near", "-1,2", "--", "-3"]),
        (["--near=-1,2", "-3"], ["--near=-1,2", "--", "-3"]),
        (["--jsn", "-3"], ["--jsn", "--", "-3"]),
        (["-x"], ["-x"]),
        (["-nan", "-INF", "-5x"], ["--", "-nan", "-INF", "-5x"]),
        (["-"], ["--", "-"]),
        (["--", "--json"], ["--", "--json"]),
        (["--near"], ["--near"]),
        ([], []),
    ],
)
def test_options_come_first(words: list[str], expected: list[str]) -> None:
    assert options_first(words, ["--near"]) == expected


@pytest.mark.parametrize("before", [0, 1, 2, 3])
def test_negative_numbers_anywhere(before: int) -> None:
    words: list[object] = [THREE_DOF, -30, 5, -5]
    words.insert(before, "--json")
    assert run("fk", *words).json["joints"] == [-30, 5, -5]


def test_negative_numbers_in_options() -> None:
    answer = run("ik", THREE_DOF, 390, 80, 300, "--near", "-30,5,-5", "--json").json
    assert answer["near"] == [-30, 5, -5]
    assert run("ik", THREE_DOF, 390, 80, 300, "--near=-30,5,-5", "--json").json == answer


def test_a_mistyped_option_is_an_error_with_a_suggestion() -> None:
    completed = run("fk", THREE_DOF, -30, 5, -5, "--jsn")
    assert (completed.code, completed.out) == (2, "")
    assert "--jsn" in completed.err
    assert "--json" in completed.err
