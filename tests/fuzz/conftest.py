"""Rounds of the fuzzers: a sample in the suite, and with ARMKIN_FUZZ=N as many as wanted."""

from __future__ import annotations

import os

import pytest


@pytest.fixture
def rounds() -> int:
    """How often each fuzzer runs its loop."""
    return int(os.environ.get("ARMKIN_FUZZ", "25"))
