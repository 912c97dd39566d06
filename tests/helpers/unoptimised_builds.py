"""Machine code for tests that ask what it says: optimising takes the compiler four to eight times as long as all else.

What is optimised says the same to the last bit, as no flag lets sums change their order; `tests/compiled` and others
that ask for the fixture `optimised` hold that, of code that is built as users have it.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import TYPE_CHECKING

import pytest

from armkin.compiled import toolchain

if TYPE_CHECKING:
    from armkin.compiled.compiled_arm import CompiledArm
    from armkin.model.arm import Arm

_load = toolchain.load_library


def load_unoptimised(source: str, content: str, level: int = 3) -> ctypes.CDLL:
    """`toolchain.load_library`, whatever the level not optimised."""
    return _load(source, content, 0)


def install() -> None:
    """For all tests of this process."""
    toolchain.load_library = load_unoptimised


@lru_cache(maxsize=16)
def _compile_optimised(arm: Arm) -> CompiledArm:
    from armkin.compiled.compiled_arm import CompiledArm

    return CompiledArm(arm)


@pytest.fixture
def optimised(monkeypatch: pytest.MonkeyPatch) -> None:
    """`armkin.compile` as users have it."""
    import armkin.compiled.compiled_arm

    monkeypatch.setattr(toolchain, "load_library", _load)
    monkeypatch.setattr(armkin.compiled.compiled_arm, "_compiled_arm", _compile_optimised)


@pytest.fixture
def quickly(optimised: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Among tests of `armkin.compile` as users have it: an arm of a class of which another one is optimised."""
    monkeypatch.setattr(toolchain, "load_library", load_unoptimised)
