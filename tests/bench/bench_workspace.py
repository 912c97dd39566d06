"""Samples per second and peak memory of the workspace survey; 10 million samples must stay under 300 MB.

python tests/bench/bench_workspace.py [SAMPLES]
"""

import subprocess
import sys
import tempfile
from pathlib import Path

ROBOT = Path(__file__).parents[2] / "robots/three_dof.yaml"
BAR_MB = 300

CASES = {
    "bounds": "volume=False",
    "bounds, volume": "",
    "bounds, .ply": "volume=False, out=folder + '/cloud.ply'",
    "bounds, .npz": "volume=False, out=folder + '/cloud.npz'",
    "bounds, step error": "volume=False, measures=['step_error']",
    "bounds, manipulability": "volume=False, measures=['manipulability']",
}
CODE = """
import resource, sys, time, armkin
arm, folder = armkin.load(sys.argv[1]), sys.argv[3]
armkin.workspace(arm, 10, volume=False)
started = time.perf_counter()
armkin.workspace(arm, int(sys.argv[2]), {options})
print(time.perf_counter() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def main() -> int:
    """Run every case in a process of its own; 1 if one needs too much memory."""
    samples = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10_000_000
    print(f"three_dof, {samples:,} samples\n\n{'':24}{'seconds':>9}{'million/s':>11}{'peak MB':>9}")
    worst = 0.0
    for name, options in CASES.items():
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", CODE.format(options=options), str(ROBOT), str(samples), folder]
            seconds, peak = map(float, subprocess.run(command, capture_output=True, check=True).stdout.split())
        print(f"{name:24}{seconds:9.2f}{samples / seconds / 1e6:11.2f}{peak:9.0f}", flush=True)
        worst = max(worst, peak)
    print(f"\npeak memory {worst:.0f} MB, allowed {BAR_MB}")
    return int(worst >= BAR_MB)


if __name__ == "__main__":
    sys.exit(main())
