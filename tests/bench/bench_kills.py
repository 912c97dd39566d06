"""Kills of worker, scheduler and client in a batch on Dask: the same bytes, or a told failure and then they.

python tests/bench/bench_kills.py worker|scheduler|client|alike [KILLS=20] [SEED=1] [ENDING=csv|npz|parquet|jsonl]
alike: one process, a pool, Dask with one and two workers, the same bytes.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[1] / "engines"))
from kills import Cluster, batch, digest, disturbed, rows

ROWS = 200_000  # seven parts


def alike(folder: Path, given: Path, expected: str, ending: str) -> bool:
    """Bytes of the engines."""
    good = True
    for name, more in {"pool of 2": ["--workers", "2"], "Dask, 1 worker": [], "Dask, 2 workers": []}.items():
        cluster = Cluster(folder, 1 + name.endswith("2 workers")) if not more else None
        out = folder / f"other.{ending}"
        process = batch(given, out, *(more if cluster is None else ["--cluster", cluster.address]))
        process.communicate()
        if cluster is not None:
            cluster.close()
        same = digest(out) == expected
        print(f"{name}: {'the same bytes as one process' if same else 'OTHER BYTES'}", flush=True)
        good &= same
    return good


def main() -> int:
    """Undisturbed once, then kills; 1 if any comes to other bytes."""
    who = sys.argv[1]
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    rng = Random(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    ending = sys.argv[4] if len(sys.argv) > 4 else "csv"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given, one = folder / "in.csv", folder / f"one.{ending}"
        rows(given, ROWS)
        process = batch(given, one)
        _, err = process.communicate()
        if process.returncode not in (0, 3):
            raise subprocess.CalledProcessError(process.returncode, "armkin", stderr=err)
        expected = digest(one)
        if who == "alike":
            return 0 if alike(folder, given, expected, ending) else 1
        good = early = redone = 0
        cluster = Cluster(folder, 2)
        for i in range(kills):
            told = disturbed(given, folder / f"out{i}.{ending}", expected, who, cluster, rng, ROWS // 32_768)
            good += told.same
            early += told.killed
            redone += told.redone
            why = told.err.strip().splitlines()[-1][:90] if told.err.strip() else ""
            print(f"{who} {i}: exit {told.code}, {told.kept} parts kept, same bytes: {told.same}; {why}", flush=True)
        cluster.close()
        print(f"{who}: {good} of {kills} the same bytes, {early} killed before the end, {redone} finished parts redone")
    return int(good < kills)


if __name__ == "__main__":
    sys.exit(main())
