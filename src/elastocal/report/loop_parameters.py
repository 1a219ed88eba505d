"""Parameters of a campaign's final model as rows of its report: those identified and those that are not."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from elastocal.diagnosis.words import candidate_words, listed, parameter_words
from elastocal.effects.protocol import effect_of
from elastocal.report.wording import capital, pm, scaled

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    import numpy as np

# Where a standard error is above this share of the prior's, the measurements say hardly more than the prior.
MOSTLY_PRIOR = 0.7
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_OTHERS = 40


def compliance_rows(compliance: Mapping[str, Sequence[float]]) -> list[list[str]]:
    """Rows of the compliances: joint, before, after with its standard error; no number of one that is not identifiable."""
    rows, identified = [], any(compliance["std_error"])
    for joint, (before, after, error) in enumerate(
        zip(*(compliance[name] for name in ("before", "after", "std_error")), strict=True), 1
    ):
        if not error:
            rows.append([str(joint), *(["not identifiable"] * 2 if identified else [f"{before:.4g}", f"{after:.4g}"])])
            continue
        stated = pm(after, error)
        decimals = len(stated.rpartition(".")[2]) if "." in stated else 0
        rows.append([str(joint), f"{before:.{decimals}f}", stated])
    return rows


def other_parameters(verdict: Mapping[str, Any], parameters: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Estimates of the declared model beside the compliances, and how many there are of them, of frames and of targets.

    `verdict`: contents of verdict.json. `parameters` (N,): of the final model. Returns ``rows`` of the table, how many more
    there are (``left_out``), and ``placement`` in words.
    """
    mine = {member for effect in verdict["effects"] for member in effect.get("members", [])}
    rows: list[list[str]] = []
    counts: Counter[str] = Counter()
    columns = (parameters[name] for name in ("owner", "parameter", "value", "std_error", "unit", "held", "prior_std"))
    for owner, name, value, error, unit, held, prior in zip(*columns, strict=True):
        if held or owner in mine or owner in ("fit", "joint_compliance") or error > MOSTLY_PRIOR * prior:
            continue
        kind = owner.split(" ")[0] if owner.startswith(("frame ", "target ")) else "declared"
        counts[kind] += 1
        if kind == "declared" or (kind == "target" and unit == "rad"):
            # Where a target sits matters to nobody; how it is mounted is what the campaign may have wrongly.
            rows.append([capital(candidate_words(owner)), parameter_words(effect_of(owner), name), *scaled(value, error, unit)])
    placed = counts["frame"] + counts["target"]
    return {
        "rows": rows[:_MOST_OTHERS],
        "left_out": max(len(rows) - _MOST_OTHERS, 0),
        "placement": listed(f"{counts[kind]} of {kind}s" for kind in ("frame", "target") if counts[kind]) if placed else "",
    }


def held_rows(held: Iterable[str]) -> list[list[str]]:
    """Parameters that the measurements do not determine, one row for each owner."""
    owners: dict[str, list[str]] = {}
    for name in held:
        owner, parameter = name.rsplit(" ", 1)
        owners.setdefault(owner, []).append(parameter_words(effect_of(owner), parameter))
    return [[capital(candidate_words(owner)), ", ".join(names)] for owner, names in owners.items()]


def left_to_priors(parameters: Mapping[str, np.ndarray]) -> list[str]:
    """Parameters about which the measurements say hardly more than their priors.

    `parameters` (N,): of the final model. Returns owner and name, as in ``held`` of verdict.json.
    """
    mine = (parameters["std_error"] > MOSTLY_PRIOR * parameters["prior_std"]) & ~parameters["held"].astype(bool)
    return [f"{owner} {name}" for owner, name in zip(parameters["owner"][mine], parameters["parameter"][mine], strict=True)]
