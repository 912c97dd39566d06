"""The second opinion on kinematics is that of the solver's tests."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "inverse"))  # oracle
