"""The two kinds of robots of the blind proof: those on which it is proved, and the one on which the method was tuned."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

PROOF, TUNED = "proof", "tuned"


def leading(kinds: Iterable[str]) -> str:
    """Which kind a figure shows: that of the proof, or where there is none the one that was tuned on."""
    return PROOF if PROOF in set(kinds) else TUNED
