"""armkin: robot arms from a YAML table to real motion.

>>> import armkin
>>> arm = armkin.load("robots/three_dof.yaml")
>>> armkin.fk(arm, [0.0, 0.0, 0.0])[:3, 3].tolist()
[455.0, 10.0, 170.0]

Millimetres and radians throughout; leading axes are batch axes. Importing this costs next to nothing:
numpy and the rest are imported with the first name that needs them.
"""

import sys as _sys
from importlib import import_module as _import_module
from types import ModuleType as _ModuleType

TYPE_CHECKING = False  # type checkers know better; importing typing would double the time of this import
__version__ = "0.1.0"

if TYPE_CHECKING:
    from armkin.arm import Arm as Arm
    from armkin.arm import load as load
    from armkin.errors import ArmkinError as ArmkinError
    from armkin.errors import FileError as FileError
    from armkin.errors import LinkError as LinkError
    from armkin.errors import MissingExtraError as MissingExtraError
    from armkin.errors import NoSolutionError as NoSolutionError
    from armkin.errors import RobotFileError as RobotFileError
    from armkin.errors import UsageError as UsageError
    from armkin.ik.closest import Closest as Closest
    from armkin.ik.closest import closest as closest
    from armkin.ik.geometry import method as method
    from armkin.ik.solutions import Solutions as Solutions
    from armkin.ik.solutions import Status as Status
    from armkin.ik.solve import ik as ik
    from armkin.ik.turns import turns as turns
    from armkin.kinematics import condition as condition
    from armkin.kinematics import fk as fk
    from armkin.kinematics import frames as frames
    from armkin.kinematics import jacobian as jacobian
    from armkin.kinematics import manipulability as manipulability
    from armkin.lock import lock as lock
    from armkin.lock import unlock as unlock
    from armkin.pulses import best_pulses as best_pulses
    from armkin.pulses import joints as joints
    from armkin.pulses import pulses as pulses
    from armkin.pulses import rounding as rounding
    from armkin.workspace import workspace as workspace

# Public name -> its module. (The block above says the same to type checkers; a test compares them.)
_HOME = {
    "Arm": "arm",
    "load": "arm",
    "ArmkinError": "errors",
    "FileError": "errors",
    "LinkError": "errors",
    "MissingExtraError": "errors",
    "NoSolutionError": "errors",
    "RobotFileError": "errors",
    "UsageError": "errors",
    "Closest": "ik.closest",
    "closest": "ik.closest",
    "method": "ik.geometry",
    "turns": "ik.turns",
    "Solutions": "ik.solutions",
    "Status": "ik.solutions",
    "ik": "ik.solve",
    "condition": "kinematics",
    "fk": "kinematics",
    "frames": "kinematics",
    "jacobian": "kinematics",
    "manipulability": "kinematics",
    "lock": "lock",
    "unlock": "lock",
    "best_pulses": "pulses",
    "joints": "pulses",
    "pulses": "pulses",
    "rounding": "pulses",
    "workspace": "workspace",
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


class _Package(_ModuleType):
    """The package keeps ``armkin.ik`` the function when the module of the same name is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, _ModuleType)):
            super().__setattr__(name, value)


_sys.modules[__name__].__class__ = _Package
