"""The next experiment that a campaign's report proposes: the states to measure, and why these."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.words import in_words
from elastocal.report.wording import minus, plain

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


def experiment_facts(rows: Sequence[Mapping[str, Any]], proposal: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Table of the states proposed, angles in degrees, and the sentence that justifies them.

    `rows`: of next_experiment.csv. `proposal`: of verdict.json: ``sentence``, or the ``reason`` why nothing is proposed.
    """
    proposal = proposal or {}
    reason = proposal.get("reason")
    sentence = proposal.get("sentence") or (f"No further measurement is proposed: {reason}." if reason else "")
    found = {"sentence": in_words(sentence), "loaded": False, "approach": False, "heads": [], "rows": [], "gains": []}
    if not rows:
        return found
    angles = [name for name in rows[0] if re.fullmatch(r"q\d+", name)]
    loads = {"fx": "N", "fy": "N", "fz": "N", "mx": "N·m", "my": "N·m", "mz": "N·m"}
    # There are no columns of loads where all states are unloaded.
    loads = loads if any(row[name] for row in rows for name in loads) else {}
    sides = [name for name in rows[0] if re.fullmatch(r"approach\d+", name)]
    weighed = any(row.get("reference_weight_kg") for row in rows)
    heads = ["point", *(f"{name} °" for name in angles), *(f"{name} {unit}" for name, unit in loads.items())]
    heads += [*(["approach"] if sides else []), *(["weight kg"] if weighed else []), "separation"]
    several = len({row["effect"] for row in rows}) > 1
    shown: list[list[str]] = []
    gains: list[tuple[str, str, str]] = []
    for row in rows:
        cells = [row["point"], *(f"{np.degrees(row[name]):.1f}" for name in angles)]
        cells += [f"{round(row[name])}" for name in loads]
        cells += ["".join("-0+"[int(np.sign(row[name])) + 1] for name in sides)] if sides else []
        cells += [plain(row["reference_weight_kg"])] if weighed else []
        cells.append(plain(row["separation"]))
        name = in_words(row["effect"])
        shown.append(([name] if several else []) + [minus(cell) for cell in cells])
        last = (name, plain(row["separation_without"]), plain(row["separation"]))
        gains = [gain for gain in gains if gain[0] != last[0]] + [last]
    heads = (["effect"] if several else []) + heads
    return found | {
        "loaded": bool(loads),
        "approach": bool(sides),
        "heads": heads,
        "rows": shown,
        "gains": [list(gain) for gain in gains],
    }
