"""A module's constant is named by its quantity, as MAX_STEPS: no bare adjective, superlative or numeral."""

from __future__ import annotations

import ast
from pathlib import Path

import armkin

SOURCE = Path(armkin.__file__).parent
NO_QUANTITY = (
    "ALIKE APART AROUND ASIDE AWAY BESIDE BETWEEN BIG CLOSE CLOSER COARSE COARSER COARSEST DEEPEST EACH EAGER EVEN FAR "
    "FARTHEST FAST FASTEST FEW FEWEST FINE FINER FINEST HEAVIEST KEEP LARGE LARGEST LATE LEAST LESS LITTLE LONG LONGER "
    "LONGEST MANY MORE MOST NEAR NEAREST ONE OWN QUICK ROUGH SHORT SHORTER SHORTEST SLOW SLOWER SLOWEST SMALL SMALLEST "
    "STEADY STILL THICK THREE TWO WIDE WIDER WIDEST WORTH"
)


def constants_of(file: Path) -> set[str]:
    """The names that a module assigns to, without their underscore."""
    statements = [node for node in ast.parse(file.read_text()).body if isinstance(node, ast.Assign | ast.AnnAssign)]
    names = (name.id for node in statements for name in ast.walk(node) if isinstance(name, ast.Name))
    return {name.lstrip("_") for name in names}


def test_a_constant_is_no_bare_adjective_or_numeral() -> None:
    bare_words = set(NO_QUANTITY.split())
    bare = {str(file.relative_to(SOURCE)): constants_of(file) & bare_words for file in SOURCE.rglob("*.py")}
    assert {file: names for file, names in bare.items() if names} == {}
