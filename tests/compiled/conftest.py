"""Code is built here as users have it."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _as_users_have_it(optimised: None) -> None:
    pass
