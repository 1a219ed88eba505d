"""Prior of the declared centres of mass: stated by the robot file, or unknown."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.candidate_design import CandidateDesign, build_candidate_design
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.search import SearchProblem
from elastocal.diagnosis.statistics import (
    CrossProducts,
    compute_cross_products,
    compute_statistics,
)
from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.fitting.least_squares import fit_model

if TYPE_CHECKING:
    from elastocal.diagnosis.fitted_subset import FittedSubset
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.model import Model


def choose_centre_prior(part: FittedSubset, settings: Settings) -> FittedSubset:
    """The kept part of a case, fitted with the prior of its centres of mass that is
    more probable; itself without masses.

    Most robot files state centres of mass as well as masses; of some nobody ever asked.
    Priors as wide as the links' girth for all robots would hide a payload, narrow ones
    would take a centre off its link for one. So both are hypotheses, equally probable
    beforehand, and the measurements choose by the evidence of each, whatever single
    mechanism may be beside it.

    `part`: with the wide prior.
    """
    stated = apply_stated_centre_prior(part.declared.model)
    if stated is part.declared.model:
        return part
    line = build_candidate_design(part.declared, part.search_sample, (), settings)
    lines = [line, line.alike(reference_fit=replace(line.reference_fit, model=stated))]
    wide, narrow = (
        _log_evidence(each, compute_cross_products(each._fitted[0], *each.priors))
        for each in lines
    )
    # A prior that is better without any mechanism is not worse with one, for a
    # mechanism explains what it leaves.
    if wide > narrow:
        every = build_candidate_design(
            part.declared,
            part.search_sample,
            list(part.case.candidates.values()),
            settings,
        )
        lines = [each.alike(tried=every.tried, against=every.against) for each in lines]
        wide, narrow = (
            _log_evidence(each, each.products, each.problem) for each in lines
        )
        if wide > narrow:
            return part
    fitted = fit_model(
        stated,
        part.search_sample,
        part.noise,
        part.declared.estimate,
        reweight_first_step=True,
    )
    return replace(
        part,
        case=replace(part.case, model=apply_stated_centre_prior(part.case.model)),
        declared=fitted,
    )


def apply_stated_centre_prior(model: Model) -> Model:
    """A declared model whose first moments are known as well as the robot file says;
    itself without declared masses."""
    weight = next(
        (effect for effect in model.effects if effect.effect == DECLARED_WEIGHT), None
    )
    if weight is None:
        return model
    stated = replace(
        weight,
        parameters=tuple(replace(p, prior_std=p.plausible) for p in weight.parameters),
    )
    return replace(
        model,
        effects=tuple(
            stated if effect is weight else effect for effect in model.effects
        ),
    )


def _log_evidence(
    line: CandidateDesign, products: CrossProducts, problem: SearchProblem | None = None
) -> float:
    """Of the measurements, up to what any prior of the declared parameters shares; with
    none or one mechanism of a problem."""
    if problem is None:
        problem = SearchProblem(
            compute_statistics(products, line.candidate_pose_errors_rad),
            (),
            line.settings,
        )
    of_declared = (
        np.linalg.slogdet(products.basis_transform)[1] - np.log(line.priors[0]).sum()
    )
    met = np.array(list(problem.started.met.values()))
    return float(of_declared + problem.started.empty.log_evidence + log_sum_exp(met))
