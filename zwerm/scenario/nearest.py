"""Suggestions for misspelt names: the known names that are most similar."""

from collections.abc import Iterable
from typing import Final

_SIMILARITY_MIN: Final = 0.7


def nearest(name: str, known: Iterable[str], count: int = 1, similarity: float = _SIMILARITY_MIN) -> list[str]:
    """Return at most `count` of the known names that are similar to `name`, the most similar first."""
    from difflib import get_close_matches  # needed for mistakes only

    return get_close_matches(name, list(known), count, similarity)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return `; did you mean X?` for the most similar known name, or the empty text where none is similar."""
    found = nearest(name, known)
    return f"; did you mean {found[0]}?" if found else ""
