"""The JSON of every command: keys, types and what they mean.

shared_keys.py          keys that many answers have, and errors
posture_answers.py      fk, pulses
branch_answers.py       ik
reach_answers.py        workspace, reach, place
robot_answers.py        info, robots, export
motion_answers.py       send, path
board_answers.py        home, jog, status, setup, zero, grip, ports, flash
calibration_answers.py  calibrate

`docs/json.md` is written from these types (scripts/json_docs.py); a test holds the two equal, and the
commands' real answers to the types. Millimetres and degrees throughout; no NaN and no infinity.
"""

from armkin.cli.answers.board_answers import Difference as Difference
from armkin.cli.answers.board_answers import Flash as Flash
from armkin.cli.answers.board_answers import Found as Found
from armkin.cli.answers.board_answers import Grip as Grip
from armkin.cli.answers.board_answers import GripOfServo as GripOfServo
from armkin.cli.answers.board_answers import Home as Home
from armkin.cli.answers.board_answers import LostSteps as LostSteps
from armkin.cli.answers.board_answers import Option as Option
from armkin.cli.answers.board_answers import Ports as Ports
from armkin.cli.answers.board_answers import Servo as Servo
from armkin.cli.answers.board_answers import Setup as Setup
from armkin.cli.answers.board_answers import SetupOfKlipper as SetupOfKlipper
from armkin.cli.answers.board_answers import Stands as Stands
from armkin.cli.answers.board_answers import StatusOfBoard as StatusOfBoard
from armkin.cli.answers.board_answers import StatusOfGrbl as StatusOfGrbl
from armkin.cli.answers.board_answers import StatusOfServos as StatusOfServos
from armkin.cli.answers.board_answers import Zero as Zero
from armkin.cli.answers.branch_answers import Branch as Branch
from armkin.cli.answers.branch_answers import Closest as Closest
from armkin.cli.answers.branch_answers import Family as Family
from armkin.cli.answers.branch_answers import Ik as Ik
from armkin.cli.answers.calibration_answers import Calibrate as Calibrate
from armkin.cli.answers.calibration_answers import Correction as Correction
from armkin.cli.answers.calibration_answers import Errors as Errors
from armkin.cli.answers.calibration_answers import Flagged as Flagged
from armkin.cli.answers.calibration_answers import Suggested as Suggested
from armkin.cli.answers.motion_answers import BranchAt as BranchAt
from armkin.cli.answers.motion_answers import DryRun as DryRun
from armkin.cli.answers.motion_answers import NearestSingularity as NearestSingularity
from armkin.cli.answers.motion_answers import Path as Path
from armkin.cli.answers.motion_answers import PathBranch as PathBranch
from armkin.cli.answers.motion_answers import PathMoved as PathMoved
from armkin.cli.answers.motion_answers import PathRun as PathRun
from armkin.cli.answers.motion_answers import Reconfiguration as Reconfiguration
from armkin.cli.answers.motion_answers import Send as Send
from armkin.cli.answers.posture_answers import Fk as Fk
from armkin.cli.answers.posture_answers import Frame as Frame
from armkin.cli.answers.posture_answers import PulsePositions as PulsePositions
from armkin.cli.answers.posture_answers import Pulses as Pulses
from armkin.cli.answers.posture_answers import Rounded as Rounded
from armkin.cli.answers.reach_answers import BestPlace as BestPlace
from armkin.cli.answers.reach_answers import Place as Place
from armkin.cli.answers.reach_answers import PlacedRobot as PlacedRobot
from armkin.cli.answers.reach_answers import PlannedPlace as PlannedPlace
from armkin.cli.answers.reach_answers import Reach as Reach
from armkin.cli.answers.reach_answers import Workspace as Workspace
from armkin.cli.answers.robot_answers import Export as Export
from armkin.cli.answers.robot_answers import Info as Info
from armkin.cli.answers.robot_answers import KeepOuts as KeepOuts
from armkin.cli.answers.robot_answers import Robots as Robots
from armkin.cli.answers.robot_answers import ShippedRobot as ShippedRobot
from armkin.cli.answers.robot_answers import Solver as Solver
from armkin.cli.answers.robot_answers import Solving as Solving
from armkin.cli.answers.shared_keys import Error as Error
from armkin.cli.answers.shared_keys import Head as Head
from armkin.cli.answers.shared_keys import Near as Near
from armkin.cli.answers.shared_keys import Violation as Violation

# Command -> its answers; a command that is not here has no --json.
ANSWERS: dict[str, tuple[type, ...]] = {
    "fk": (Fk,),
    "ik": (Ik,),
    "pulses": (Pulses,),
    "workspace": (Workspace,),
    "reach": (Reach,),
    "place": (Place,),
    "info": (Info,),
    "robots": (Robots,),
    "export": (Export,),
    "send": (DryRun, Send),
    "path": (Path, PathMoved),
    "status": (StatusOfBoard, StatusOfGrbl, StatusOfServos),
    "home": (Home,),
    "jog": (Stands,),
    "grip": (Grip, GripOfServo),
    "calibrate": (Calibrate, Suggested),
    "setup": (Setup, SetupOfKlipper),
    "zero": (Zero,),
    "ports": (Ports,),
    "flash": (Flash,),
}
