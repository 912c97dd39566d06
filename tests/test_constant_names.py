"""A module's constant is named by its quantity, as MAX_STEPS: no bare verb, adjective, superlative or numeral."""

from __future__ import annotations

import ast

from source_trees import MODULES, syntax_tree

NO_QUANTITY = (
    "AGAIN AHEAD ALIKE APART AROUND ASIDE ASKING AWAY BEGINNING BEGINS BESIDE BETWEEN BIG BOOT BUSY CAN CLOSE CLOSER "
    "COARSE COARSER COARSEST CREEP DEBOUNCE DEEPEST DENSE EACH EAGER ENDLESS EVEN EVERY FAR FARTHEST FAST FASTEST FEW "
    "FEWEST FINE FINER FINEST FORGET FRESH FULL GRIPPING GROW GROWS HANDLE HEAVIEST HOMING INTERRUPTED JUMP KEEP KEPT "
    "KNOWN LARGE LARGEST LASTING LATE LEAST LESS LISTENS LITTLE LONG LONGER LONGEST LOOK LOOKED LOOKS LOST MANY "
    "MIDDLE MONOTONE MORE MOST NEAR NEAREST NONSENSE ONE OWN PENDING POLL PROBES QUEUED QUICK QUIET RESEND REST ROUGH "
    "SETTLING SHARED SHORT SHORTER SHORTEST SILENCE SILENT SLOW SLOWER SLOWEST SMALL SMALLEST SPLIT STANDING STARTING "
    "STAYS STEADY STILL STOOD STRANGERS TELL THICK THREE TIMES TOLD TOP TWO UNANSWERED UNBOUNDED UNCHECKED UNCLEAR "
    "UNDO UNHEARD VISIBLE WATCH WAYS WHOLE WIDE WIDER WIDEST WORTH"
)


def constants_of(module: str) -> set[str]:
    """The names that a module assigns to, without their underscore."""
    statements = [node for node in syntax_tree(MODULES[module]).body if isinstance(node, ast.Assign | ast.AnnAssign)]
    names = (name.id for node in statements for name in ast.walk(node) if isinstance(name, ast.Name))
    return {name.lstrip("_") for name in names}


def test_a_constant_is_no_bare_verb_adjective_or_numeral() -> None:
    bare_words = set(NO_QUANTITY.split())
    bare = {module: constants_of(module) & bare_words for module in MODULES}
    assert {module: names for module, names in bare.items() if names} == {}
