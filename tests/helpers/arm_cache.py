"""An arm that is loaded again is the one that was built before, in tests that run in this process.

What is prepared of an arm, its recorded formulas and its solver, is kept by arm: else each of some thousand tests
prepares it anew. The robot file is read and validated each time, and must say the same as before.
"""

from __future__ import annotations

from collections.abc import Sequence

import armkin.keep_out.load_with_scene
import armkin.model.build_arm
from armkin.model.arm import Arm
from armkin.robot_file import RobotFile
from armkin.robot_file.scene_file import Scene

_build = armkin.model.build_arm.arm_of_file
_arms: dict[tuple[str, str], Arm] = {}


def build_once(file: RobotFile, scene: Scene | None = None, tool: Sequence[float] | None = None) -> Arm:
    """`armkin.model.build_arm.arm_of_file`, once for each robot file."""
    if scene is not None or tool is not None:
        return _build(file, scene, tool)
    key = file.path, file.sha256
    if key not in _arms or _arms[key].file != file:
        if len(_arms) > 100:
            _arms.clear()
        _arms[key] = _build(file)
    arm = _arms[key]
    names = (file.name, *(joint.name for joint in file.joints))
    assert (arm.name, *arm.joint_names) == names, "a test before this one changed the arm of all: it may `replace` it"
    return arm


def install() -> None:
    """For all tests of this process."""
    armkin.model.build_arm.arm_of_file = build_once
    armkin.keep_out.load_with_scene.arm_of_file = build_once  # type: ignore[attr-defined]
