"""A fit carried to other measurements: their frames and targets, and the effects that can act there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import LOADED_JOINTS
from elastocal.fitting.least_squares import fit_frames
from elastocal.fitting.observations import select_states

if TYPE_CHECKING:
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations, States


def placed(fitted: Fit, case: Case, part: Case) -> tuple[Model, Estimate]:
    """Model and estimate for other measurements: as fitted, or with frames and targets of another campaign.

    `case`: which it was fitted to. `part`: measurements of the same campaign or of another one.
    """
    if same_campaign(case, part):
        return fitted.model, placed_estimate(fitted, part.observations)
    carried = carried_over(fitted, part.model, part.observations.states)
    model = replace(part.model, nominal_compliance=fitted.model.nominal_compliance, effects=carried.model.effects)
    return model, fit_frames(carried, model, part.observations)


def same_campaign(case: Case, part: Case) -> bool:
    """Whether two cases are parts of one campaign."""
    return part is case or part.campaign.name == case.campaign.name


def placed_estimate(fitted: Fit, observations: Observations) -> Estimate:
    """The estimate of a fit for other observations of its targets, whose sessions it may not have seen.

    A tracker set up anew stands somewhere else: the frame of such a session is fitted to the very observations that test it,
    six numbers of each session, and so its errors come out slightly too small. Everything else stays.
    """
    found = fitted.estimate
    unseen = ~np.isin(observations.states.session, found.sessions)
    if not unseen.any():
        return found
    there = fit_frames(fitted, fitted.model, select_states(observations, unseen), own_targets=False)
    sessions = (*found.sessions, *there.sessions)
    order = np.argsort(sessions)
    return replace(
        found,
        sessions=tuple(sessions[number] for number in order),
        frame_rotation=np.concatenate([found.frame_rotation, there.frame_rotation])[order],
        frame_position=np.concatenate([found.frame_position, there.frame_position])[order],
    )


def carried_over(fitted: Fit, model: Model, states: States) -> Fit:
    """A fit without the effects that another campaign cannot have, or does not record: a wandering tracker, a temperature.

    `states`: of the other campaign.
    """
    there = model.offered(states) | {*LOADED_JOINTS, "external load"}
    kept = [n for n, effect in enumerate(fitted.model.effects) if not effect.of_setup and effect.needs <= there]
    known = replace(fitted.model, effects=tuple(fitted.model.effects[n] for n in kept))
    coefficients, shapes = fitted.estimate.coefficients, fitted.estimate.shapes
    estimate = replace(
        fitted.estimate, coefficients=tuple(coefficients[n] for n in kept), shapes=tuple(shapes[n] for n in kept)
    )
    return replace(fitted, model=known, estimate=estimate)
