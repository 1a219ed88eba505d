"""Warn of estimates at the end of a grid or of a range.

Every size and shape of a diagnosis is averaged or searched over values between two ends.
An estimate at an end says that the measurements ask for a value beyond it, so that
something else may absorb what the value cannot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.noise import PRIOR_SCALES, find_declared_geometry

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.diagnosis.search import ScoredModel
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.fitting.least_squares import Fit

# Distance from an end of its range, as a share of the range, within which a shape counts
# as at the end: the least squares clip a shape to its range.
_AT_END = 1e-3
# Relative distance within which two sizes are the same, up to rounding.
_SAME = 1e-6


def warn_of_grid_ends(final: Fit, evidence: Evidence) -> list[str]:
    """Return a warning for each estimate at an end of its grid or range.

    Parameters
    ----------
    final : Fit
        The final model.
    evidence : Evidence
        Result of the search for it.
    """
    model = evidence.named_model
    warnings = [
        *_warn_of_pose_error(model, evidence),
        *_warn_of_geometry(final),
        *_warn_of_sizes(model, evidence),
        *_warn_of_shapes(final),
    ]
    return list(dict.fromkeys(warnings))


def _warn_of_pose_error(model: ScoredModel, evidence: Evidence) -> Iterator[str]:
    design = evidence.design
    if np.isfinite(design.max_pose_error_rad):
        # A residual that is a function of the joints limits the pose error, and a
        # warning of its own says so.
        return
    largest_rad = design.candidate_pose_errors_rad.max()
    if model.pose_error_rad > (1.0 - _SAME) * largest_rad:
        yield (
            "the error that the measurements of a pose share is estimated at the end of"
            f" its grid, {1e6 * largest_rad:.0f} µrad: a larger error may be mistaken for"
            " an effect"
        )


def _warn_of_geometry(final: Fit) -> Iterator[str]:
    geometry = find_declared_geometry(final.model)
    limit = (1.0 - _SAME) * PRIOR_SCALES[-1]
    for effect in final.model.effects:
        is_declared = effect.effect in geometry
        if is_declared and all(
            parameter.prior_std is not None
            and parameter.prior_std > limit * parameter.plausible
            for parameter in effect.parameters
        ):
            yield (
                "the usual size of the errors of the declared geometry is estimated at"
                f" the end of its grid, {PRIOR_SCALES[-1]:g} times the manufacturing"
                " tolerance: compare the robot file with the robot"
            )


def _warn_of_sizes(model: ScoredModel, evidence: Evidence) -> Iterator[str]:
    problem = evidence.design.problem
    coefficients = iter(problem.find_mode(model)[1])
    for index, scale in zip(model.term_indices, model.scales, strict=True):
        term = problem.terms[index]
        values = np.array([next(coefficients) for _ in term.columns])
        largest = problem.grid.scales[term.largest]
        is_last = scale > (1.0 - _SAME) * largest
        if term.candidate and is_last and np.sqrt((values**2).mean()) > largest:
            yield (
                f"{term.candidate.key}: its size is estimated at the end of its grid,"
                f" {largest:g} × the reference size of such effects"
            )


def _warn_of_shapes(final: Fit) -> Iterator[str]:
    for effect in final.model.effects:
        values = final.effect_values(effect.key)[1]
        for shape, value in zip(effect.shapes, values, strict=True):
            margin = _AT_END * (shape.highest - shape.lowest)
            if not shape.lowest + margin < value < shape.highest - margin:
                yield (
                    f"{effect.key}: its {shape.name} is estimated at the end of its"
                    f" range, {value:.3g} {shape.unit}: its law may be different"
                )
