"""The JSON of every command: keys, types and what they mean.

kinematics.py           answers about an arm, and errors
branch_answers.py       answers of ik
calibration_answers.py  answers of calibrate
motion_and_board.py     answers about an arm that moves, and about its board

`docs/json.md` is written from these types (scripts/json_docs.py); a test holds the two equal, and the
commands' real answers to the types. Millimetres and degrees throughout; no NaN and no infinity.
"""

from armkin.cli.answers.branch_answers import Branch as Branch
from armkin.cli.answers.branch_answers import Closest as Closest
from armkin.cli.answers.branch_answers import Family as Family
from armkin.cli.answers.branch_answers import Ik as Ik
from armkin.cli.answers.calibration_answers import Calibrate as Calibrate
from armkin.cli.answers.calibration_answers import Correction as Correction
from armkin.cli.answers.calibration_answers import Errors as Errors
from armkin.cli.answers.calibration_answers import Flagged as Flagged
from armkin.cli.answers.calibration_answers import Suggested as Suggested
from armkin.cli.answers.kinematics import BestPlace as BestPlace
from armkin.cli.answers.kinematics import Error as Error
from armkin.cli.answers.kinematics import Export as Export
from armkin.cli.answers.kinematics import Fk as Fk
from armkin.cli.answers.kinematics import Flash as Flash
from armkin.cli.answers.kinematics import Found as Found
from armkin.cli.answers.kinematics import Frame as Frame
from armkin.cli.answers.kinematics import Head as Head
from armkin.cli.answers.kinematics import Info as Info
from armkin.cli.answers.kinematics import KeepOuts as KeepOuts
from armkin.cli.answers.kinematics import Near as Near
from armkin.cli.answers.kinematics import Place as Place
from armkin.cli.answers.kinematics import PlacedRobot as PlacedRobot
from armkin.cli.answers.kinematics import PlannedPlace as PlannedPlace
from armkin.cli.answers.kinematics import Ports as Ports
from armkin.cli.answers.kinematics import PulsePositions as PulsePositions
from armkin.cli.answers.kinematics import Pulses as Pulses
from armkin.cli.answers.kinematics import Reach as Reach
from armkin.cli.answers.kinematics import Robots as Robots
from armkin.cli.answers.kinematics import Rounded as Rounded
from armkin.cli.answers.kinematics import ShippedRobot as ShippedRobot
from armkin.cli.answers.kinematics import Solver as Solver
from armkin.cli.answers.kinematics import Solving as Solving
from armkin.cli.answers.kinematics import Violation as Violation
from armkin.cli.answers.kinematics import Workspace as Workspace
from armkin.cli.answers.motion_and_board import BranchAt as BranchAt
from armkin.cli.answers.motion_and_board import Difference as Difference
from armkin.cli.answers.motion_and_board import DryRun as DryRun
from armkin.cli.answers.motion_and_board import Grip as Grip
from armkin.cli.answers.motion_and_board import GripOfServo as GripOfServo
from armkin.cli.answers.motion_and_board import Home as Home
from armkin.cli.answers.motion_and_board import LostSteps as LostSteps
from armkin.cli.answers.motion_and_board import NearestSingularity as NearestSingularity
from armkin.cli.answers.motion_and_board import Option as Option
from armkin.cli.answers.motion_and_board import Path as Path
from armkin.cli.answers.motion_and_board import PathBranch as PathBranch
from armkin.cli.answers.motion_and_board import PathMoved as PathMoved
from armkin.cli.answers.motion_and_board import PathRun as PathRun
from armkin.cli.answers.motion_and_board import Reconfiguration as Reconfiguration
from armkin.cli.answers.motion_and_board import Send as Send
from armkin.cli.answers.motion_and_board import Servo as Servo
from armkin.cli.answers.motion_and_board import Setup as Setup
from armkin.cli.answers.motion_and_board import SetupOfKlipper as SetupOfKlipper
from armkin.cli.answers.motion_and_board import Stands as Stands
from armkin.cli.answers.motion_and_board import StatusOfBoard as StatusOfBoard
from armkin.cli.answers.motion_and_board import StatusOfGrbl as StatusOfGrbl
from armkin.cli.answers.motion_and_board import StatusOfServos as StatusOfServos
from armkin.cli.answers.motion_and_board import Zero as Zero

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
