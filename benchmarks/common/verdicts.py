"""The variants of sensor coverage, and the verdict on a run: whether `completed` is true."""

from typing import Final

# The least reachable coverage at which `completed` is true.
ENOUGH: Final = 0.98
VARIANTS: Final = {"central": (), "decentralised": ("services.path=gradient",)}


def verdict(outcome: str, seen: float) -> str:
    """Return `right` or `false` for a run that is completed with a reachable coverage `seen`; else its outcome."""
    if outcome != "completed":
        return outcome
    return "right" if seen >= ENOUGH else "false"
