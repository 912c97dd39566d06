"""An arm with two parallel axes that is not shipped, beside those that are."""

from __future__ import annotations

from oracle import Screws, screws_of
from shipped_arms import shipped_arm

from armkin import Arm
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file

# the shape of a Kinova Gen3 Lite: axes 2 and 3 parallel
GEN3_LITE = """
name: gen3_lite_like
convention: standard
task: pose
joints:
""" + "\n".join(
    f"  - {{name: J{i + 1}, dh: {{alpha: {alpha}, a: {a}, d: {d}, theta: {theta}}}, limits: [-360, 360]}}"
    for i, (alpha, a, d, theta) in enumerate(
        [(90, 0, 243.3, 0), (180, 280, 30, 90), (90, 0, 20, 90), (90, 0, 245, 90), (90, 0, 57, 180), (0, 0, 235, 90)]
    )
)


def arm_and_screws(name: str) -> tuple[Arm, Screws]:
    if name != "gen3_lite":
        return shipped_arm(name)
    file = parse_robot_file(GEN3_LITE)
    return arm_of_file(file), screws_of(file)
