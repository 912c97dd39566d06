"""The handshake of interrupt and main loop: all interleavings of a model, and what each precaution is for."""

from __future__ import annotations

import pytest
from handshake import CALLS, MUTANTS, explore_states


def test_no_interleaving_of_interrupt_and_main_loop_miscounts() -> None:
    states, broken = explore_states(CALLS)
    assert broken == ""
    assert states > 20_000


@pytest.mark.parametrize("name", MUTANTS)
def test_without_a_precaution_some_interleaving_does(name: str) -> None:
    call, steps = MUTANTS[name]
    assert explore_states(CALLS | {call: steps})[1]
