"""URDFs that people could not have meant: each ends in one or two lines, or in a robot file that loads."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

import armkin
from command_line import run, run_process
from least_time import least_seconds

WORDS = [
    *("", "a: b # \"x\" 'y'", "a\u0085b", "a\u2028b", "a\tb", "\u00e4\u20ac\U0001f600", "x" * 5000, "{a: b}", "[1]"),
    *("!tag", "*al", "%d", "- a", "null", "~", "1e5", "a\\nb", "\u202eabc", "a\ufeffb", "a\x9b31m", "\ud7ff"),
]
VALUES = ["1 2", "1 2 3 4", "nan 0 0", "inf 0 0", "1e400 0 0", "1e9 0 0", "0x1 0 0", "1,2,3", "9999 9999 9999", "0 0 0"]
LIMITS = [
    *('lower="1" upper="-1"', 'lower="1" upper="1"', 'upper="1"', "", 'lower="-1e300" upper="1e300"'),
    *('lower="-1" upper="1" velocity="-1"', 'lower="-1" upper="1" velocity="1e-300"', 'lower="-1e9" upper="1e9"'),
    *('lower="-1" upper="1" velocity="1e300"', 'lower="0" upper="1e-12"', 'lower="2" upper="3"', 'lower="nan"'),
]


def hostile_urdf(
    names: tuple[str, ...] = ("a", "b", "c"),
    links: str = "l",
    kind: str = "revolute",
    xyz: str = "0 0 0.1",
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    limit: str = 'lower="-1" upper="1" velocity="1"',
    extra: str = "",
) -> str:
    text = [f"<robot name={quoteattr(links)}>", *(f"<link name={quoteattr(f'{links}{k}')}/>" for k in range(4))]
    text += [
        f"<joint name={quoteattr(name)} type={quoteattr(kind)}><parent link={quoteattr(f'{links}{k}')}/>"
        f"<child link={quoteattr(f'{links}{k + 1}')}/><origin xyz={quoteattr(xyz)} rpy={quoteattr(rpy)}/>"
        f"<axis xyz={quoteattr(axis)}/><limit {limit}/>{extra}</joint>"
        for k, name in enumerate(names)
    ]
    return "\n".join([*text, "</robot>"])


CASES: dict[str, str | bytes] = {
    **{f"links {word[:9]!a}": hostile_urdf(links=word) for word in WORDS},
    **{f"names {word[:9]!a}": hostile_urdf(names=(f"{word}1", f"{word}2", "q")) for word in WORDS},
    **{f"kind {word[:9]!a}": hostile_urdf(kind=word) for word in WORDS},
    **{f"mimic {word[:9]!a}": hostile_urdf(extra=f"<mimic joint={quoteattr(word)}/>") for word in WORDS},
    **{f"xyz {value[:9]!a}": hostile_urdf(xyz=value) for value in [*VALUES, *WORDS[:4]]},
    **{f"rpy {value[:9]!a}": hostile_urdf(rpy=value) for value in [*VALUES, *WORDS[:4]]},
    **{f"axis {value[:9]!a}": hostile_urdf(axis=value) for value in [*VALUES, *WORDS[:4]]},
    **{
        f"{kind} {limit}": hostile_urdf(limit=limit, kind=kind)
        for kind in ("revolute", "prismatic")
        for limit in LIMITS
    },
    "utf-16": hostile_urdf().encode("utf-16"),
    "unknown encoding": b'<?xml version="1.0" encoding="foo"?>' + hostile_urdf().encode(),
    "a zero byte": hostile_urdf().encode().replace(b"l1", b"l\x001"),
    "noise": np.random.default_rng(1).bytes(1000),
    "cut off": hostile_urdf()[:300],
    "twice": hostile_urdf() + hostile_urdf(),
    "another file": '<!DOCTYPE r SYSTEM "file:///etc/passwd">' + hostile_urdf(),
    "nested": "<robot name='r'>" + "<a>" * 100_000,
    "large": "<robot name='r'>" + "<link name='x'/>" * 600_000,
    "100000 attributes": "<robot " + " ".join(f"a{k}='1'" for k in range(100_000)) + "/>",
    "a long name": f"<robot name='{'x' * 4_000_000}'/>",
}


@pytest.mark.parametrize("name", CASES)
def test_it_ends_in_words_or_in_a_robot_file(name: str, tmp_path: Path) -> None:
    raw = CASES[name]
    path, made = tmp_path / "x.urdf", tmp_path / "x.yaml"
    path.write_bytes(raw if isinstance(raw, bytes) else raw.encode("utf-8", "surrogatepass"))
    results = []
    assert least_seconds(lambda: results.append(run("import", path)), 2.0) < 2.0
    completed = results[0]
    assert "internal error" not in completed.err
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u202e]", completed.err)
    if completed.code == 0:
        made.write_text(completed.out)
        arm = armkin.load(made)
        assert np.isfinite(armkin.fk(arm, np.zeros(arm.n))).all()
        return
    assert (completed.code in (2, 4), completed.out) == (True, "")
    assert len(completed.err.splitlines()) <= 2
    assert max(map(len, completed.err.splitlines())) < 700


def test_what_looks_like_another_unit_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "x.urdf"
    path.write_text(hostile_urdf(xyz="0 0 250", limit='lower="-180" upper="180"'))
    completed = run("import", path)
    assert completed.code == 0
    assert "l3 is 750 m from l0: a URDF is in metres, are these millimetres?" in completed.err
    assert "joint a turns -10313.2" in completed.err
    assert "a URDF is in radians, are these degrees?" in completed.err
    path.write_text(hostile_urdf(limit='lower="-1e16" upper="1e16"'))
    endless = run("import", path)
    assert "joint a has limits beyond 1000000 deg: read as no limits" in endless.err
    assert "limits:" not in endless.out.replace("has limits", "")


def test_a_pipe_is_read_once(tmp_path: Path) -> None:
    """`armkin import <(xacro arm.xacro)` and `xacro arm.xacro | armkin import -`."""
    rough = hostile_urdf(rpy="1.570796 0 0")
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    writer = threading.Thread(target=lambda: fifo.write_text(rough))
    writer.start()
    completed = run_process("import", fifo)
    writer.join()
    piped = run("import", "-", stdin=rough.encode())
    assert (completed.code, piped.code) == (0, 0)
    assert completed.out.splitlines()[3:] == piped.out.splitlines()[3:]
