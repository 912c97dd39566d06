"""Singular postures are those of the tests of `inverse`."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "inverse"))  # oracle, truth
