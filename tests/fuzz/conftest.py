"""Rounds of the fuzzers: a sample in the suite, a million inputs with --long, or as many as ARMKIN_FUZZ says."""

from __future__ import annotations

import os

import pytest

SAMPLE = 25
A_MILLION = 40_000  # rounds, of 25 inputs and more over all fuzzers: files 36, words 8, rows 4, answers 2, devices 3


@pytest.fixture
def rounds(request: pytest.FixtureRequest) -> int:
    """How often each fuzzer runs its loop."""
    if "ARMKIN_FUZZ" in os.environ:
        return int(os.environ["ARMKIN_FUZZ"])
    return A_MILLION if request.config.getoption("--long") else SAMPLE
