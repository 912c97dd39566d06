"""armkin: robot arms from a YAML table to real motion.

>>> import armkin
>>> arm = armkin.load("robots/three_dof.yaml")
>>> armkin.fk(arm, [0.0, 0.0, 0.0])[:3, 3].tolist()
[455.0, 10.0, 170.0]

Millimetres and radians throughout; leading axes are batch axes. Importing this costs next to nothing:
numpy and the rest are imported with the first name that needs them.

Where things are, in the order of the data; each folder's `__init__.py` lists its files, docs/architecture.md has more:

robot_file/ model/          a robot file, checked; the arm that it describes
forward.py inverse/         where the tool is; the joint values that reach a target
keep_out/  what the arm must not touch, and how far it is from it
path_file/ motion/          a path as a file or drawing; joint values over time
motors.py board/ flash/     pulses of motors; boards that turn them; armkin's firmware onto a board
board_catalogue.py  what boards and drivers can do, and which kinds are installed
reachability/ calibration/  where an arm reaches, where to put it; a robot file corrected by measured tips
formula/ compiled/          formulas recorded once; machine code made of them
export/  the arm as URDF, DH table, C, JavaScript
view/ plot/ teach/          an arm's lines and points; pictures; the page in the browser
columns/ engines/           many answers as CSV, npz, Parquet; long work in processes and on clusters
cli/  the command line
errors.py files.py          what is raised; files that appear whole or not at all
signals.py user_folders.py  Ctrl-C; where this user's locks and compiled arms lie
"""

from importlib import import_module as _import_module

TYPE_CHECKING = False  # type checkers know better; importing typing would double the time of this import
__version__ = "1.0.0"

if TYPE_CHECKING:
    from armkin.calibration.calibrate_arm import calibrate as calibrate
    from armkin.compiled.compiled_arm import CompiledArm as CompiledArm
    from armkin.compiled.compiled_arm import compile as compile
    from armkin.errors import ArmkinError as ArmkinError
    from armkin.errors import FileError as FileError
    from armkin.errors import LinkError as LinkError
    from armkin.errors import MissingExtraError as MissingExtraError
    from armkin.errors import NoSolutionError as NoSolutionError
    from armkin.errors import PathFileError as PathFileError
    from armkin.errors import RobotFileError as RobotFileError
    from armkin.errors import UsageError as UsageError
    from armkin.forward import condition as condition
    from armkin.forward import fk as fk
    from armkin.forward import frames as frames
    from armkin.forward import jacobian as jacobian
    from armkin.forward import manipulability as manipulability
    from armkin.inverse.answers.closest import Closest as Closest
    from armkin.inverse.answers.closest import closest as closest
    from armkin.inverse.answers.solutions import Solutions as Solutions
    from armkin.inverse.answers.solutions import Status as Status
    from armkin.inverse.branches.whole_turns import turns as turns
    from armkin.inverse.solve import ik as ik
    from armkin.inverse.solvers.solver_of_arm import method as method
    from armkin.keep_out.clearance import Clearance as Clearance
    from armkin.keep_out.clearance import clearance as clearance
    from armkin.keep_out.load_with_scene import load as load
    from armkin.model.arm import Arm as Arm
    from armkin.model.lock_joints import lock as lock
    from armkin.model.lock_joints import unlock as unlock
    from armkin.motion.drawing_to_path import drawing as drawing
    from armkin.motion.path_planner.path import path as path
    from armkin.motion.plan.path_plan import PathPlan as PathPlan
    from armkin.motion.time_law import time_law as time_law
    from armkin.motors import best_pulses as best_pulses
    from armkin.motors import joints as joints
    from armkin.motors import pulses as pulses
    from armkin.motors import rounding as rounding
    from armkin.reachability.place.place_search import Place as Place
    from armkin.reachability.place.place_search import place as place
    from armkin.reachability.reach_map import Reach as Reach
    from armkin.reachability.reach_map import reach as reach
    from armkin.reachability.workspace_survey import workspace as workspace

# Public name -> its module. (The block above says the same to type checkers; a test compares them.)
_HOME = {
    "CompiledArm": "compiled.compiled_arm",
    "compile": "compiled.compiled_arm",
    "calibrate": "calibration.calibrate_arm",
    "ArmkinError": "errors",
    "FileError": "errors",
    "LinkError": "errors",
    "MissingExtraError": "errors",
    "NoSolutionError": "errors",
    "PathFileError": "errors",
    "RobotFileError": "errors",
    "UsageError": "errors",
    "condition": "forward",
    "fk": "forward",
    "frames": "forward",
    "jacobian": "forward",
    "manipulability": "forward",
    "turns": "inverse.branches.whole_turns",
    "Closest": "inverse.answers.closest",
    "closest": "inverse.answers.closest",
    "method": "inverse.solvers.solver_of_arm",
    "Solutions": "inverse.answers.solutions",
    "Status": "inverse.answers.solutions",
    "ik": "inverse.solve",
    "Clearance": "keep_out.clearance",
    "clearance": "keep_out.clearance",
    "load": "keep_out.load_with_scene",
    "Arm": "model.arm",
    "lock": "model.lock_joints",
    "unlock": "model.lock_joints",
    "drawing": "motion.drawing_to_path",
    "path": "motion.path_planner.path",
    "time_law": "motion.time_law",
    "PathPlan": "motion.plan.path_plan",
    "best_pulses": "motors",
    "joints": "motors",
    "pulses": "motors",
    "rounding": "motors",
    "Reach": "reachability.reach_map",
    "reach": "reachability.reach_map",
    "Place": "reachability.place.place_search",
    "place": "reachability.place.place_search",
    "workspace": "reachability.workspace_survey",
}

__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> object:
    module = _HOME.get(name)
    if module is None:
        raise AttributeError(f"module 'armkin' has no attribute '{name}'; it has {', '.join(_HOME)}")
    value = getattr(_import_module(f"armkin.{module}"), name)
    globals()[name] = value  # the next look-up does not come here
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
