"""What all tests need; helpers such as `command_line` are modules of `helpers/`, which is on the import path."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import settings
from xdist.remote import Producer

from slow import SLOW
from worker_shares import Distribution, mix_order

# Before numpy is imported: its threads bring small matrices nothing, and those of two workers wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is noted of pseudo-terminals is no business of the boards of who runs the tests.
os.environ["XDG_STATE_HOME"] = os.path.join(tempfile.gettempdir(), "armkin-tests")

# What Python compiles is kept, whatever this computer says: else each of some thousand commands compiles armkin again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# The same examples in every run: what fails, fails for everybody. `--hypothesis-profile=explore` looks for new ones.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("explore", derandomize=False, deadline=None)
settings.load_profile("same")
# Since 6.130 it also tries numbers that stand in whatever modules are imported by then: with several workers, other
# ones in every run, as it was left to how fast each of them was.
_providers: Any = sys.modules.get("hypothesis.internal.conjecture.providers")
if hasattr(_providers, "_get_local_constants") and hasattr(_providers, "_local_constants"):
    _providers._get_local_constants = lambda: _providers._local_constants

if sys.platform == "win32":  # no pseudo-terminals there, and no emulator
    _NEEDS = ("pty_board", "pty_port", "import pty", "import fcntl", "emulator")
    _FILES = Path(__file__).parent.rglob("test_*.py")
    collect_ignore = [str(path) for path in _FILES if any(word in path.read_text("utf-8") for word in _NEEDS)]
    collect_ignore.append("firmware")  # its conftest.py needs the emulator, too

# A shell's background job and nohup ignore these, and what a test starts would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# What is collected stays until the end: looking through it for garbage again and again took a third of the collecting.
gc.disable()

import arm_cache  # noqa: E402
import unoptimised_builds  # noqa: E402
from unoptimised_builds import optimised, quickly  # noqa: E402, F401  # fixtures

arm_cache.install()
unoptimised_builds.install()

_HERE = Path(__file__).parent
# Helpers that compile the firmware, or run it in the emulator.
_HELPERS = {"emulator", "measure", "bare_host"}
_TOOLS = ("avr-gcc", "arm-none-eabi-gcc", "npm")
_NO_COMPILER = "needs avr-gcc, simavr, arm-none-eabi-gcc and npm: scripts/test installs them"


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--long`: full counts where the gate takes a sample."""
    parser.addoption("--long", action="store_true", help="full counts for a sample: the fuzzers' million, fifty kills")


@pytest.fixture(scope="session")
def sample(pytestconfig: pytest.Config) -> Callable[[int, int], int]:
    """How many of something a test takes: `sample(full, few)` is all of them with --long, else a few."""
    return max if pytestconfig.getoption("--long") else min


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Files of which `-m "not slow"` or `-m "not emulator"` leaves out every test are not read: half of all reading."""
    left_out = str(config.option.markexpr)
    if "not emulator" in left_out and collection_path == _HERE / "firmware":
        return True
    named = collection_path.is_relative_to(_HERE) and collection_path.relative_to(_HERE).as_posix()
    return True if "not slow" in left_out and SLOW.get(str(named)) == () else None


@pytest.fixture(autouse=True)
def _no_port_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """ARMKIN_PORT is somebody's arm."""
    monkeypatch.delenv("ARMKIN_PORT", raising=False)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow tests, and those of the firmware; without its compiler they are skipped, and say why.

    Where there are several workers slow ones come first.
    """
    for item in items:
        if _is_slow(item):
            item.add_marker(pytest.mark.slow)
        if not _needs_emulator(item.path, getattr(item, "module", None)):
            continue
        item.add_marker(pytest.mark.emulator)
        if any(shutil.which(tool) is None for tool in _TOOLS):
            item.add_marker(pytest.mark.skip(reason=_NO_COMPILER))
    if "PYTEST_XDIST_WORKER" in os.environ:
        slow = [item for item in items if _is_slow(item)]
        items[:] = mix_order(slow, [item for item in items if not _is_slow(item)])


def pytest_collection_finish() -> None:
    """What tests leave is garbage again, what was collected is not looked at any more.

    Arms that are kept make each look long: at Python's own 700 new objects a fortieth of all computing.
    """
    gc.freeze()
    gc.enable()
    gc.set_threshold(100_000, 10, 10)


@cache
def _slow_names(path: Path) -> tuple[str, ...] | None:
    """The slow tests of a file; all of them: ()."""
    return SLOW.get(path.relative_to(_HERE).as_posix()) if path.is_relative_to(_HERE) else None


def _is_slow(item: pytest.Item) -> bool:
    names = _slow_names(item.path)
    return names is not None and (not names or getattr(item, "originalname", item.name) in names)


@cache
def _needs_emulator(path: Path, module: ModuleType | None) -> bool:
    """Whether the tests of a file do."""
    if "firmware" in path.parts:
        return True
    used = vars(module).values() if module else ()
    return any(getattr(x, "__name__" if isinstance(x, ModuleType) else "__module__", None) in _HELPERS for x in used)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Distribution:
    """Files of tests that share something go to one worker, whatever `--dist` says."""
    config.option.loadscopereorder = False  # the order is that of `mixed`
    return Distribution(config, log)


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """`-n auto`, which is the default here: three for two cores for folders, one process for a few named tests.

    Snapshots are written by one process, too.
    """
    named = [word for word in config.invocation_params.args if "::" in word or word.endswith(".py")]
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS") or 0 < len(named) <= 2:
        return 0
    # a third of the tests wait for a board that keeps real time
    return min(3 * (os.cpu_count() or 1) // 2, 8)
