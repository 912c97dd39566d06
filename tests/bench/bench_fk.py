"""Forward kinematics in batches against Robotics Toolbox's ETS, in one run, one thread.

pip install -e '.[bench]'
OMP_NUM_THREADS=1 python tests/bench/bench_fk.py
"""

from __future__ import annotations

from typing import Any

import numpy as np
from bench_ik import ROBOTS, best_time, random_joints

import armkin


def toolbox_arm(arm: armkin.Arm) -> Any:
    """The same arm as an elementary transform sequence, or None if the toolbox is not installed."""
    try:
        from roboticstoolbox import DHRobot, RevoluteDH
    except ImportError:
        return None
    links = []
    assert arm.file is not None
    for joint in arm.file.joints:
        dh = joint.dh
        assert dh is not None
        links.append(RevoluteDH(d=dh.d, a=dh.a, alpha=np.deg2rad(dh.alpha), offset=np.deg2rad(dh.theta)))
    return DHRobot(links).ets().compile()


def main() -> None:
    print("| arm | poses | armkin us/pose | Robotics Toolbox us/pose | times faster | largest difference mm |")
    print("|---|---|---|---|---|---|")
    for name in ("three_dof", "puma560", "ur5e"):
        arm = armkin.load(ROBOTS / f"{name}.yaml")
        q = random_joints(arm, 100_000)
        ets = toolbox_arm(arm)
        jobs = [lambda: armkin.fk(arm, q)]
        if ets is not None:
            jobs.append(lambda: ets.eval(q))
        times = best_time(*jobs, repeat=9)
        ours = times[0] / len(q) * 1e6
        if ets is None:
            print(f"| {name} | {len(q)} | {ours:.3f} | - | - | - |")
            continue
        difference = np.abs(ets.eval(q) - armkin.fk(arm, q)).max()
        theirs, ratio = times[1] / len(q) * 1e6, times[1] / times[0]
        print(f"| {name} | {len(q)} | {ours:.3f} | {theirs:.3f} | {ratio:.1f} | {difference:.1e} |")


if __name__ == "__main__":
    main()
