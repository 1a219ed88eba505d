"""How far centres of mass may be from where the robot file has them: as it states, or anywhere in the girth of their links.

Most files state centres as well as masses; of some nobody ever asked. Priors as wide as the links' girth for all robots would
hide a payload, narrow ones would take a centre off its link for one. So both are hypotheses, equally probable beforehand, and
the measurements choose by the evidence of each, whatever single mechanism there may be beside it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.hypotheses import Prior
from elastocal.diagnosis.linearize import Linearized, linearized
from elastocal.diagnosis.search import Problem
from elastocal.diagnosis.statistics import Products, products_of, statistics_of
from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.fitting.least_squares import fit

if TYPE_CHECKING:
    from elastocal.diagnosis.kept_rows import Kept
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.model import Model


def with_probable_centres(part: Kept, settings: Settings) -> Kept:
    """The kept part of a case, fitted with the prior of its centres of mass that is more probable.

    `part`: with the wide prior. Returns itself where that stays, or no masses are declared.
    """
    stated = with_stated_centres(part.declared.model)
    if stated is part.declared.model:
        return part
    line = linearized(part.declared, part.searched, list(part.case.candidates.values()), settings)
    lines = [line, line.under(stated)]
    wide, narrow = (_log_evidence(each, products_of(each.declared_rows, *each.priors)) for each in lines)
    # A prior that is better without any mechanism is not worse with one, for a mechanism explains what it leaves.
    if wide > narrow:
        wide, narrow = (_log_evidence(each, each.products, each.problem) for each in lines)
        if wide > narrow:
            return part
    fitted = fit(stated, part.searched, part.noise, part.declared.estimate, reweighted=True)
    return replace(part, case=replace(part.case, model=with_stated_centres(part.case.model)), declared=fitted)


def with_stated_centres(model: Model) -> Model:
    """A declared model whose first moments are known as well as the robot file says; itself without declared masses."""
    weight = next((effect for effect in model.effects if effect.effect == DECLARED_WEIGHT), None)
    if weight is None:
        return model
    stated = replace(weight, parameters=tuple(replace(p, prior_std=p.plausible) for p in weight.parameters))
    return replace(model, effects=tuple(stated if effect is weight else effect for effect in model.effects))


def _log_evidence(line: Linearized, products: Products, problem: Problem | None = None) -> float:
    """Of the measurements, up to what any prior of the declared parameters shares; with none or one mechanism of a problem."""
    if problem is None:
        problem = Problem(statistics_of(products, line.pose_errors_rad), (), Prior({}, {}), line.settings)
    of_declared = np.linalg.slogdet(products.into_basis)[1] - np.log(line.priors[0]).sum()
    met = np.array(list(problem.started.met.values()))
    return float(of_declared + problem.started.empty.log_evidence + log_sum_exp(met))
