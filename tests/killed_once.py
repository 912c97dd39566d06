"""Work for engines whose third chunk kills its process, the first time; here alone, so that workers can import it."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def square(mark: str, chunk: int) -> int:
    """A chunk's square; mark: a file that is there when a process has been killed."""
    if chunk == 2 and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return chunk * chunk
