"""Entries of the league to columns of their table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elastocal_proof.league.methods import Entry


def entry_columns(entry: Entry, fold: int, other: int) -> dict[str, np.ndarray]:
    """Columns of one fold.

    `fold`: from 1. `other`: number of the other data set that is the test, from 1; 0 where it is a part of the same. Returns
    (M,).
    """
    seen, states = entry.observations, entry.observations.states
    columns = {"fold": np.full(len(seen), fold), "set": np.full(len(seen), other)}
    columns |= {name: getattr(states, name)[seen.state] for name in ("session", "pose", "load")}
    columns |= {"target": seen.target, "outside_range": entry.outside}
    columns |= {f"d{axis}": entry.residual[:, number] for number, axis in enumerate("xyz")}
    return columns | {f"std_{axis}": entry.std[:, number] for number, axis in enumerate("xyz")}
