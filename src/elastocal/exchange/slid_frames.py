"""Joint frames moved along their own axes to near the one before, which changes no pose behind them.

A turn about z and a shift along z commute: ``Tz(s) Rz(q) Tz(-s) = Rz(q)``, and so for ``Tz(q)``. Where two axes are nearly
parallel, their common normal is anywhere along them, and a calibrated Denavit-Hartenberg table has lengths d of hundreds of
metres that cancel [1]; the frames of a chain need not be there.

[1] Hayati, S., Robot arm geometric link parameter estimation, 22nd IEEE Conference on Decision and Control, 1983.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from elastocal.exchange.fixed_transforms import displacement_words, elementary

# A displacement, ndarray (4, 4), and the measuring point at its end; empty for none.
Piece = tuple[np.ndarray, str]
_SHIFT = re.compile(r"T[xyz]\((-?[0-9.]+)\)", re.ASCII)


def lengths_of(words: Sequence[str]) -> float:
    """Sum of all fixed lengths of a chain, m."""
    return sum(abs(float(match[1])) for word in words if (match := _SHIFT.fullmatch(word)))


def slid_words(gaps: Sequence[Sequence[Piece]], kinds: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """A chain in words whose joints lie as near as their axes allow to the joint before, and how far each was moved.

    `gaps`: displacements before, between and behind n joints, which move about or along z. `kinds` (n,) of str: ``P`` of
    prismatic joints. Returns `slides` (n + 1,): m along z of each joint, and 0 before for the base.
    """
    words: list[str] = []
    slides = np.zeros(len(gaps))
    for number, gap in enumerate(gaps):
        here = elementary("T", 2, -slides[number])
        for place, (piece, point) in enumerate(gap):
            here = here @ piece
            last = place == len(gap) - 1 and number < len(kinds)
            if last:
                # Of the points of the next axis the nearest one.
                slides[number + 1] = -here[:3, 2] @ here[:3, 3]
                here = here @ elementary("T", 2, slides[number + 1])
            if point or last or place == len(gap) - 1:
                words += displacement_words(here)
                words += [f"[{point}]"] if point else []
                here = np.eye(4)
        if number < len(kinds):
            words.append(f"{'T' if kinds[number] == 'P' else 'R'}z(q{number + 1})")
    return words, slides
