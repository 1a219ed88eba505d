"""What a search found, and what else might have been found, to columns of tables."""

import numpy as np

from elastocal.screening import cross_validated_gains
from elastocal.selection import FOLDS


def candidate_columns(candidates):
    """Columns that name candidates."""
    return {
        "candidate": [candidate.key for candidate in candidates],
        "effect": [candidate.effect for candidate in candidates],
        "family": [candidate.family for candidate in candidates],
        "joints": ["+".join(map(str, candidate.joints)) for candidate in candidates],
    }


def look_blocks(looks, candidates):
    """Blocks of the looks table, one for each look; the first also lists the candidates that could not be tested.

    Parameters
    ----------
    looks : sequence of Look
    candidates : dict of str to Candidate

    Yields
    ------
    dict
    """
    for number, look in enumerate(looks):
        tested = [candidate for candidate, _ in look.directions.candidates]
        left = [] if number else [candidates[key] for key in look.directions.untestable]
        count, untested = len(tested), np.full(len(left), np.nan)
        block = {"look": np.full(count + len(left), number)} | candidate_columns([*tested, *left])
        shapes = [values[0] if len(values) else np.nan for _, values in look.directions.candidates]
        block["shape"] = np.concatenate([shapes, untested])
        block["parameters"] = np.concatenate([look.scores.parameters, np.zeros(len(left))])
        for name in ("statistic", "p_value", "p_family", "bic_gain"):
            block[name] = np.concatenate([getattr(look.scores, name), untested])
        gains = np.full((2, count), np.nan)
        if count and not number:
            gains = np.array(cross_validated_gains(look.directions, range(count), FOLDS))
        for name, values in zip(("heldout_gain", "heldout_gain_std_error"), gains, strict=True):
            block[name] = np.concatenate([values, untested])
        block["retained"] = np.concatenate([look.directions.retained, untested])
        block["noncentrality"] = np.concatenate([look.directions.noncentrality, untested])
        block["chosen"] = np.arange(count + len(left)) == (-1 if look.chosen is None else look.chosen)
        refused = ["does not predict poses that were left out" if c.key in look.refused else "" for c in tested]
        block["note"] = refused + [look.directions.untestable[candidate.key] for candidate in left]
        yield block


def found_columns(search):
    """Columns of the found table."""
    rows = np.array(list(search.chosen.values())).reshape(-1, 3)
    return candidate_columns(search.effects) | dict(zip(("p_family", "gain", "gain_std_error"), rows.T, strict=True))


def rival_blocks(attributions):
    """Blocks of the rivals table, one for each effect found."""
    for attribution in attributions:
        yield {
            "found": [attribution.effect] * len(attribution.rivals),
            "candidate": list(attribution.rivals),
            "angle_deg": attribution.angle_deg,
            "bic_difference": attribution.bic_difference,
            "parameters": attribution.rival_parameters,
            "found_parameters": np.full(len(attribution.rivals), attribution.found_parameters),
            "alternative": np.isin(attribution.rivals, attribution.alternatives),
        }


def confounding_columns(seen, angles):
    """Columns of the confounding table: every pair of tested candidates once."""
    keys = [candidate.key + (f" {values[0]:.3g}" if len(values) else "") for candidate, values in seen.candidates]
    rows, columns = np.tril_indices(len(keys), -1)
    return {
        "one": [keys[row] for row in rows],
        "other": [keys[column] for column in columns],
        "angle_deg": angles[rows, columns],
    }
