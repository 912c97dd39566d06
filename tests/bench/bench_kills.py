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
from cluster_kills import Cluster, begin_batch, disturb_batch, file_digest, write_rows

ROWS = 200_000  # seven parts


def engines_agree(folder: Path, source: Path, expected: str, ending: str) -> bool:
    """Bytes of the engines."""
    good = True
    for name, more in {"pool of 2": ["--workers", "2"], "Dask, 1 worker": [], "Dask, 2 workers": []}.items():
        cluster = Cluster(folder, 1 + name.endswith("2 workers")) if not more else None
        target = folder / f"other.{ending}"
        process = begin_batch(source, target, *(more if cluster is None else ["--cluster", cluster.address]))
        process.communicate()
        if cluster is not None:
            cluster.close()
        same = file_digest(target) == expected
        print(f"{name}: {'the same bytes as one process' if same else 'OTHER BYTES'}", flush=True)
        good &= same
    return good


def main() -> int:
    """Undisturbed once, then kills; 1 if any comes to other bytes."""
    victim = sys.argv[1]
    kills = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    rng = Random(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
    ending = sys.argv[4] if len(sys.argv) > 4 else "csv"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, undisturbed = folder / "in.csv", folder / f"one.{ending}"
        write_rows(source, ROWS)
        process = begin_batch(source, undisturbed)
        _, err = process.communicate()
        if process.returncode not in (0, 3):
            raise subprocess.CalledProcessError(process.returncode, "armkin", stderr=err)
        expected = file_digest(undisturbed)
        if victim == "alike":
            return 0 if engines_agree(folder, source, expected, ending) else 1
        good = early = redone = 0
        cluster = Cluster(folder, 2)
        for i in range(kills):
            run = disturb_batch(source, folder / f"out{i}.{ending}", expected, victim, cluster, rng, ROWS // 32_768)
            good += run.same
            early += run.killed
            redone += run.redone
            why = run.err.strip().splitlines()[-1][:90] if run.err.strip() else ""
            print(f"{victim} {i}: exit {run.code}, {run.kept} parts kept, same bytes: {run.same}; {why}", flush=True)
        cluster.close()
        print(
            f"{victim}: {good} of {kills} the same bytes, {early} killed before the end, {redone} finished parts redone"
        )
    return int(good < kills)


if __name__ == "__main__":
    sys.exit(main())
