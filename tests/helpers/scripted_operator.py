"""Somebody who answers `armkin begin`, by keys that a test writes down."""

from __future__ import annotations

from collections.abc import Callable, Sequence

ENTER = "\n"


class ScriptedOperator:
    """Presses keys in an order: a joint's key is held for as long as it may go, or for `looks` looks at it."""

    def __init__(self, keys: Sequence[str], looks: int = 10_000) -> None:
        self.keys, self._looks = list(keys), looks
        self.heard: list[str] = []

    def say(self, text: str) -> None:
        self.heard.append(text)

    def key(self) -> str:
        return self.keys.pop(0)

    def ask(self, question: str, answers: str) -> str:
        self.heard.append(question)
        answer = self.keys.pop(0)
        assert answer in answers, (question, answer)
        return answer

    def held(self, key: str) -> Callable[[], bool] | None:
        looks = iter(range(self._looks))
        return lambda: next(looks, None) is not None


def keys_for_direction(answer: str) -> list[str]:
    """A joint is moved, and what was seen is said."""
    return ["+", ENTER, answer]
