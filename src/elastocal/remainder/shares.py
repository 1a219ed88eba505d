"""How much of the error physics explains, how much a regression on its remainder, and whether the stated intervals hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.corrected import corrected
from elastocal.remainder.tuning import CONFIDENCE, NORMAL_WIDTH
from elastocal.validation.held_out import Errors, intervals, position_errors, summary
from elastocal.validation.placing import placed

if TYPE_CHECKING:
    from typing import Any

    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.remainder.corrected import Plan

_REPLICATES = 1000


def remainder_facts(
    plan: Plan, declared: Fit, final: Fit, case: Case, held_out: Case, beyond: np.ndarray, draws: np.random.Generator
) -> dict[str, Any]:
    """Held-out errors with a regression on what the final model leaves, beside those without.

    `declared`, `final`: to the training poses. `case`: of the training poses. `beyond`: as in `corrected`. `draws`: of the
    bootstrap over poses. Returns ``regression``, empty where none helps, and its ``words``; ``errors``, the summary of
    `held_out.summary` with it; ``rms_ci95_m``; of the squared error that the declared model leaves the shares that effects
    (``physics``) and the regression (``regression_share``) explain and that is ``left``; ``reduction_ci95`` of the RMS by the
    regression alone; ``covered``, the share of coordinates inside the stated 95 % intervals, and ``half_width_m``, half of
    their median width within and outside the range; ``outside``, poses outside the range of those fitted, at which nothing is
    corrected.
    """
    before, after = (position_errors(*placed(fitted, case, held_out), held_out.observations) for fitted in (declared, final))
    found = corrected(plan, final, case, held_out, beyond)
    with_it = Errors(np.linalg.norm(found.residual, axis=1), before.cluster)
    limits, reductions = intervals([after, with_it], _REPLICATES, draws)
    squares = [float((errors.distance**2).mean()) for errors in (before, after, with_it)]
    name, words = (found.regression.NAME, found.regression.WORDS) if found.regression else ("", "")
    facts: dict[str, Any] = {
        "regression": name,
        "words": words,
        "errors": {name: float(value) for name, value in summary(with_it.distance).items()},
        "rms_ci95_m": [float(end) for end in limits[1]["rms_m"]],
        "reduction_ci95": [reductions[1].low, reductions[1].high],
        "physics": 1.0 - squares[1] / squares[0],
        "regression_share": (squares[1] - squares[2]) / squares[0],
        "left": squares[2] / squares[0],
        "outside": len(np.unique(before.cluster[found.outside])),
        "confidence": CONFIDENCE,
    }
    if found.std is None:
        return facts | {"covered": None, "half_width_m": None}
    width = NORMAL_WIDTH * found.std
    each = {"within": width[~found.outside], "outside": width[found.outside]}
    return facts | {
        "covered": float((np.abs(found.residual) < width).mean()),
        "half_width_m": {name: float(np.median(part)) if part.size else None for name, part in each.items()},
    }
