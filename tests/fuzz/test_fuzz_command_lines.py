"""Random words, numbers, JSON and CSV: an answer or an error in words."""

from __future__ import annotations

import json
import string
from pathlib import Path

import pytest
from attack import NUMBERS, attack, random_generator

COMMANDS = (
    "fk",
    "ik",
    "pulses",
    "workspace",
    "info",
    "send",
    "plot",
    "export",
    "robots",
    "schema",
    "path",
    "calibrate",
)
OPTIONS = [
    "--json",
    "--batch",
    "--out",
    "--near",
    "--branch",
    "--turns",
    "--task",
    "--lock",
    "--sweep",
    "--all-branches",
    "--frames",
    "--from",
    "--best",
    "--samples",
    "--grid",
    "--seed",
    "--dry-run",
    "--speed",
    "--target",
    "--urdf",
    "--dh",
    "--no-such",
    "-o",
    "-p",
    "--port",
    "--via",
    "--blend",
    "--continuous",
    "--poses",
    "--snap",
]
ROBOTS = ["three_dof", "robots/ur5e.yaml", "planar_2dof", "cobra600", "panda", "robots", "no_such", "three_dof.yml"]
MANY = {"1000000", "1.0e+6", "1.0e+7", "1.0e+9"}
TEXTS = (
    "home",
    "left elbow up",
    "pose",
    "xyz",
    "q1=20",
    "q1=0:10:3",
    "0,90,-90",
    "390,80,300",
    "-",
    "sim",
    "q9=1",
    ",",
    "=",
)


@pytest.mark.parametrize("seed", range(4))
def test_any_words(seed: int, rounds: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random_generator(seed)
    monkeypatch.delenv("DISPLAY", raising=False)
    for _ in range(2 * rounds):
        words: list[str] = [rng.choice(COMMANDS), rng.choice(ROBOTS)]
        for _ in range(rng.randrange(8)):
            kind = rng.randrange(5)
            if kind < 2:
                words.append(rng.choice(NUMBERS))
            elif kind == 2:
                option = rng.choice(OPTIONS)
                words.insert(2 if option == "--json" else len(words), option)  # never the value of another option
            elif kind == 3:
                words.append(rng.choice(TEXTS))
            else:
                words.append("".join(rng.choices(string.printable, k=rng.randrange(12))))
        positions = [k for k, word in enumerate(words[:-1]) if word in ("--out", "-o", "--trace", "--plot")]
        for k in positions:
            words[k + 1] = str(tmp_path / "out.csv")
        if words[0] == "plot" and not positions:
            words += ["--out", str(tmp_path / "picture.svg")]
        if words[0] == "workspace":  # as many samples as a million inputs have time for
            words = ["50" if word in MANY else word for word in words]
            words += ["--samples", "50"] if rng.random() < 0.98 else []
        attack(*words, stdin=rng.choice((b"", b"0,90,-90\n", b"{}", b"\xff\n")))


@pytest.mark.parametrize("seed", range(2))
def test_any_rows(seed: int, rounds: int) -> None:
    rng = random_generator(seed)
    for _ in range(rounds):
        rows = [
            ",".join(rng.choice(NUMBERS) if rng.random() < 0.2 else f"{rng.uniform(-90, 90):.3f}" for _ in range(3))
            for _ in range(rng.randrange(6))
        ]
        if rng.random() < 0.3:
            rows.insert(0, rng.choice(("q1,q2,q3", "x,y,z", "q3,q1,q2", "q1,q1,q1", "branch,q1,q2,q3", "", "#")))
        data = "\n".join(rows).encode() + rng.choice((b"", b"\n", b"\r\n", b"\x00", b"\xff"))
        attack(rng.choice(("fk", "ik", "pulses")), "three_dof", "--batch", "-", "--json", stdin=data)
        attack("send", "three_dof", "--batch", "-", "--dry-run", stdin=data)


@pytest.mark.parametrize("seed", range(2))
def test_any_piped_answer(seed: int, rounds: int) -> None:
    rng = random_generator(seed)
    intact = json.loads(attack("pulses", "three_dof", 10, 80, -70, "--json").out)
    odd: list[object] = [None, True, "x", 10**400, -1, 1e300, [], {}, [1e9] * 3, "three_dof", 1.5, [[1]], [None] * 3]
    for _ in range(rounds):
        answer = dict(intact)
        for _ in range(rng.randrange(1, 3)):
            answer[rng.choice(list(answer))] = rng.choice(odd)
        text = json.dumps(answer)
        if rng.random() < 0.3:
            k = rng.randrange(len(text))
            text = text[:k] + rng.choice('{}[],:"e9 ') + text[k + 1 :]
        completed = attack("send", "--dry-run", "--json", stdin=text.encode())
        if completed.code == 0:  # what is sent is what was asked for
            assert json.loads(completed.out)["pulses"] == intact["pulses"], text


@pytest.mark.parametrize(
    ("key", "value"),
    [("joints", [10, 80, -60]), ("pulses", [356, -1194, 0]), ("pulses", [10**400, 0, 0]), ("pulses", [0])],
)
def test_an_answer_that_contradicts_itself_moves_nothing(key: str, value: list[int]) -> None:
    answer = json.loads(attack("pulses", "three_dof", 10, 80, -70, "--json").out)
    completed = attack("send", "--port", "sim", "--json", stdin=json.dumps({**answer, key: value}).encode())
    assert completed.code == 2
    if len(value) == 3 and value[0] < 10**9:
        assert "q3 = -" in json.loads(completed.err)["error"]
        assert json.loads(completed.err)["joint"] == "q3"
    best = json.loads(attack("pulses", "three_dof", 10.01, 80.01, -70.01, "--best", "--json").out)
    assert (
        json.loads(attack("send", "--dry-run", "--json", stdin=json.dumps(best).encode()).out)["pulses"]
        == best["pulses"]
    )
