"""How far the redundant joint turns while the tip stays: the page's arithmetic beside the families of `armkin.ik`."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np

import armkin
from armkin.model import units
from armkin.teach.arm_description import scene_json
from armkin.teach.server import STATIC

_ASK = """
import { interval } from './redundant.mjs';
import { readFileSync } from 'node:fs';
const [arm, q] = JSON.parse(readFileSync('asked.json', 'utf8'));
console.log(JSON.stringify(q.map((one) => interval(arm, one, 6))));
"""


def test_the_interval_is_that_of_the_family(tmp_path: Path) -> None:
    arm = armkin.load("panda")
    q = np.random.default_rng(3).uniform(arm.lower + 0.1, arm.upper - 0.1, (12, 7))
    outside = q[0] + [0, 0, 0, 3.0, 0, 0, 0]
    node = shutil.which("node")
    assert node, "node runs the module; scripts/test installs it"
    shutil.copy(STATIC / "js" / "redundant.js", tmp_path / "redundant.mjs")
    (tmp_path / "ask.mjs").write_text(_ASK)
    question = [scene_json(arm), units.joints_out(arm, np.concatenate([q, outside[None]])).tolist()]
    (tmp_path / "asked.json").write_text(json.dumps(question))
    completed = subprocess.run([node, "ask.mjs"], cwd=tmp_path, check=True, capture_output=True, text=True, timeout=300)
    *intervals, none = json.loads(completed.stdout)
    assert none is None
    s = armkin.ik(arm, armkin.fk(arm, q), near=q)
    assert s.interval is not None
    rows = np.arange(len(q))
    assert np.abs(s.q[rows, s.best] - q).max() < 1e-6
    assert np.abs(np.rad2deg(s.interval[rows, s.best]) - intervals).max() < 1e-3
