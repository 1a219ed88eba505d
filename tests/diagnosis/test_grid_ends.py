"""Warnings of estimates at an end of their grid or range."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal.diagnosis.grid_ends import warn_of_grid_ends
from elastocal.effects.protocol import Shape
from elastocal.fitting.noise import PRIOR_SCALES, set_prior_scale


def replace_model(evidence, **changes):
    """Return evidence whose models all have other numbers."""
    models = tuple(replace(model, **changes) for model in evidence.posterior.models)
    return replace(evidence, posterior=replace(evidence.posterior, models=models))


def test_estimates_inside_their_grids_are_not_warned_of(diagnosis):
    assert warn_of_grid_ends(diagnosis.final, diagnosis.evidence) == []


def test_a_pose_error_at_the_end_of_its_grid_is_warned_of(diagnosis):
    sizes = diagnosis.evidence.design.candidate_pose_errors_rad
    for size, count in ((sizes[-1], 1), (sizes[-2], 0)):
        evidence = replace_model(diagnosis.evidence, pose_error_rad=size)
        assert len(warn_of_grid_ends(diagnosis.final, evidence)) == count


@pytest.mark.parametrize(("scale", "count"), [(PRIOR_SCALES[-1], 1), (1.0, 0)])
def test_geometry_at_the_widest_prior_is_warned_of(diagnosis, scale, count):
    effect = next(
        effect
        for effect in diagnosis.case.candidates.values()
        if effect.effect == "link_geometry"
    )
    final = diagnosis.final
    model = set_prior_scale(final.model.with_effects([effect]), scale)
    estimate = final.estimate.with_effects([effect])
    sentences = warn_of_grid_ends(
        replace(final, model=model, estimate=estimate), diagnosis.evidence
    )
    assert sum("declared geometry" in sentence for sentence in sentences) == count


@pytest.mark.parametrize(("value", "count"), [(2.0, 1), (1.0, 1), (1.5, 0)])
def test_a_shape_at_an_end_of_its_range_is_warned_of(diagnosis, value, count):
    final = diagnosis.final
    shape = Shape("torque", "N m", 1.5, 1.0, 2.0)
    effects = (
        replace(final.model.effects[0], shapes=(shape,)),
        *final.model.effects[1:],
    )
    shapes = (np.array([value]), *final.estimate.shapes[1:])
    changed = replace(
        final,
        model=replace(final.model, effects=effects),
        estimate=replace(final.estimate, shapes=shapes),
    )
    assert len(warn_of_grid_ends(changed, diagnosis.evidence)) == count


def test_a_size_beyond_the_end_of_its_grid_is_warned_of(diagnosis):
    evidence = diagnosis.evidence
    problem = evidence.design.problem
    model = evidence.named_model
    grid = replace(problem.grid, scales=problem.grid.scales * 1e-2)
    vars(problem)["grid"] = grid
    try:
        scales = [grid.scales[problem.terms[n].largest] for n in model.term_indices]
        pinned = replace_model(evidence, scales=np.array(scales))
        sentences = warn_of_grid_ends(diagnosis.final, pinned)
    finally:
        del vars(problem)["grid"]
    assert any("size is estimated at the end" in sentence for sentence in sentences)
