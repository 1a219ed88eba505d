"""Prior of the declared centres of mass: stated by the robot file, or as wide as the
links' girth.

Most robot files state centres of mass as well as masses, but some of these centres were
never measured. Priors as wide as the links' girth for all robots would hide a payload;
narrow ones would let a payload stand in for a centre off the link axis. So both are
hypotheses with equal prior probability, and the measurements choose by the evidence of
each, with none or any single mechanism in the model.
"""

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


def choose_centre_prior(subset: FittedSubset, settings: Settings) -> FittedSubset:
    """Choose the more probable prior of the centres of mass.

    Parameters
    ----------
    subset : part of a case, fitted with the wide prior
    settings : settings of the diagnosis

    Returns
    -------
    The same part fitted with the chosen prior; the same object if that is the wide one,
    or if no masses are declared
    """
    wide_model = subset.declared.model
    stated_model = apply_stated_centre_prior(wide_model)
    if stated_model is wide_model:
        return subset
    if _is_wide_more_probable(subset, stated_model, settings):
        return subset
    fitted = fit_model(
        stated_model,
        subset.search_sample,
        subset.noise,
        subset.declared.estimate,
        reweight_first_step=True,
    )
    case = replace(subset.case, model=apply_stated_centre_prior(subset.case.model))
    return replace(subset, case=case, declared=fitted)


def _is_wide_more_probable(
    subset: FittedSubset, stated_model: Model, settings: Settings
) -> bool:
    wide = build_candidate_design(subset.declared, subset.search_sample, (), settings)
    stated = replace(
        wide, reference_fit=replace(wide.reference_fit, model=stated_model)
    )
    # A prior that is worse without any mechanism is not better with one, because a
    # mechanism explains a part of what the prior leaves.
    if _log_evidence_alone(wide) <= _log_evidence_alone(stated):
        return False
    candidates = list(subset.case.candidates.values())
    tested = build_candidate_design(
        subset.declared, subset.search_sample, candidates, settings
    )
    wide, stated = (
        replace(design, tried=tested.tried, discrepancies=tested.discrepancies)
        for design in (wide, stated)
    )
    wide_evidence = _log_evidence(wide, wide.products, wide.problem)
    return wide_evidence > _log_evidence(stated, stated.products, stated.problem)


def apply_stated_centre_prior(model: Model) -> Model:
    """Give the first moments of a model the prior that the robot file states; the same
    object if no masses are declared."""
    effects = list(model.effects)
    for index, effect in enumerate(effects):
        if effect.effect == DECLARED_WEIGHT:
            parameters = tuple(
                replace(parameter, prior_std=parameter.plausible)
                for parameter in effect.parameters
            )
            effects[index] = replace(effect, parameters=parameters)
            return replace(model, effects=tuple(effects))
    return model


def _log_evidence_alone(design: CandidateDesign) -> float:
    """Log evidence of the measurements without any mechanism, as `_log_evidence`."""
    products = compute_cross_products(design.whitened.rows, *design.priors)
    statistics = compute_statistics(products, design.candidate_pose_errors_rad)
    problem = SearchProblem(statistics, (), design.settings)
    return _log_evidence(design, products, problem)


def _log_evidence(
    design: CandidateDesign, products: CrossProducts, problem: SearchProblem
) -> float:
    """Log evidence of the measurements with none or one mechanism of a problem, up to
    what all priors of the declared parameters share."""
    deviations, _ = design.priors
    log_volume = np.linalg.slogdet(products.basis_transform)[1]
    of_declared = log_volume - np.log(deviations).sum()
    search = problem.initial_search
    log_odds = np.array(list(search.log_odds.values()))
    return float(
        of_declared + search.empty_evidence.log_evidence + log_sum_exp(log_odds)
    )
