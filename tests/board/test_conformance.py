"""Every kind of board passes the suite that ships for kinds of others; ours as its model in this process."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from armkin.board import conformance
from emulated_kinds import EMULATED, run_sample


@pytest.mark.parametrize("case", conformance.CASES, ids=lambda case: case.__name__)
@pytest.mark.parametrize("kind", EMULATED)
def test_every_kind_conforms(kind: str, case: Callable[..., None]) -> None:
    run_sample(case, kind)
