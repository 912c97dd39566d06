"""Work for engines: a chunk that kills its process, chunks that last; here alone, so that workers can import it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def square_or_die(mark: str, chunk: int) -> int:
    """A chunk's square; the third one kills its process, unless a file `mark` says that one has been killed."""
    if chunk == 2 and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return chunk * chunk


def wait_for_ever(_: str, chunk: int) -> int:
    """The process that answers; those behind the second chunk last for ever."""
    if chunk > 1:
        time.sleep(3600)
    return os.getpid()
