"""Strict YAML: what is a value, what is a trap, and on which line."""

import math

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from armkin.robot_file import strict_yaml
from armkin.robot_file.strict_yaml import StrictYamlError, load_yaml
from hostile_robot_files import VALID, hostile_files


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0),
        ("-0", 0),
        ("42", 42),
        ("+42", 42),
        ("-42", -42),
        ("0.5", 0.5),
        ("-0.5", -0.5),
        ("+0.5", 0.5),
        (".5", 0.5),
        ("5.", 5.0),
        ("1.0e+3", 1000.0),
        ("1.0E-3", 0.001),
        ("true", True),
        ("False", False),
        ("word", "word"),
        ("12mm", "12mm"),
        ("1.2.3", "1.2.3"),
        ("-", None),
        ("+", "+"),
        ("1,5", "1,5"),
        ("'80:16'", "80:16"),
        ('"off"', "off"),
        ("'1e3'", "1e3"),
        ("''", ""),
        ("|\n  two\n  lines", "two\nlines"),
        (">\n  one\n  line", "one line"),
        ("Y", "Y"),  # the axis; PyYAML and YAML 1.2 read text
        ("[]", ()),
        ("{}", {}),
        ("[1, [2.5, x]]", (1, (2.5, "x"))),
        ("{b: {c: [true]}}", {"b": {"c": (True,)}}),
    ],
)
def test_values(text: str, value: object) -> None:
    if value is None:
        with pytest.raises(StrictYamlError):
            load_yaml(f"a: {text}")
        return
    read = load_yaml(f"a: {text}").data["a"]
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize("text", ["1", "-3", "0.25", "-1.5e-3", "text", "'017'", "true", ".5", "10."])
def test_accepted_values_are_what_pyyaml_reads(text: str) -> None:
    assert load_yaml(f"a: {text}").data == yaml.safe_load(f"a: {text}")


@settings(max_examples=300, deadline=None)
@given(st.text("0123456789+-.eE_:xXobinfaNy ", min_size=1, max_size=8))
def test_a_plain_scalar_is_read_as_pyyaml_does_or_refused(text: str) -> None:
    """No number is silently another number, and no text silently a number."""
    try:
        read = load_yaml(f"a: {text}").data["a"]
    except StrictYamlError:
        return
    expected = yaml.safe_load(f"a: {text}")["a"]
    assert type(read) is type(expected)
    assert read == expected
    assert not isinstance(read, float) or math.isfinite(read)


@settings(max_examples=100, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_as_pyyaml_writes_them_come_back(number: float) -> None:
    assert load_yaml(yaml.safe_dump({"a": number})).data == {"a": number}


def test_lines_are_those_of_keys_and_items() -> None:
    document = load_yaml("# head\na: 1\nb:\n  - c: 2\n    d:\n      [1,\n       2]\n  - 3\n")
    lines = {(): 2, ("a",): 2, ("b",): 3, ("b", 0): 4, ("b", 0, "c"): 4, ("b", 0, "d"): 5}
    assert document.lines == lines | {("b", 0, "d", 0): 6, ("b", 0, "d", 1): 7, ("b", 1): 8}
    assert document.line(("b", 0, "d", 1)) == 7
    assert document.line(("b", 0, "missing", "deeper")) == 4


def test_error_carries_line_and_problem() -> None:
    with pytest.raises(StrictYamlError) as caught:
        load_yaml("a: 1\nb: 017\n")
    assert caught.value.line == 2
    assert caught.value.problem.startswith("017 begins with 0")
    assert str(caught.value) == f"2: {caught.value.problem}"


def test_mac_and_windows_line_ends_count_as_lines() -> None:
    for end in ("\n", "\r\n", "\r"):
        with pytest.raises(StrictYamlError, match=r"^3: "):
            load_yaml(end.join(["a: 1", "b: 2", "c: 017"]))


@pytest.mark.parametrize("name", VALID)
def test_both_parsers_read_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    fast = load_yaml(VALID[name])
    monkeypatch.setattr(strict_yaml, "_LOADER", yaml.SafeLoader)
    slow = load_yaml(VALID[name])
    assert (slow.data, slow.lines) == (fast.data, fast.lines)


def test_both_parsers_refuse_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without libyaml the words of a syntax error differ; what is refused does not."""

    def outcome(raw: bytes) -> str:
        try:
            load_yaml(raw)
        except StrictYamlError as error:
            return "not YAML" if error.problem.startswith("not YAML") else str(error)
        return "read"

    small = {name: raw for name, raw in hostile_files().items() if len(raw) < 20_000}
    fast = {name: outcome(raw) for name, raw in small.items()}
    monkeypatch.setattr(strict_yaml, "_LOADER", yaml.SafeLoader)
    assert {name: outcome(raw) for name, raw in small.items()} == fast
