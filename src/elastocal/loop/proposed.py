"""The next experiment for a campaign that was diagnosed in one call, from its folder and what was said of it."""

from dataclasses import replace

import numpy as np

from elastocal.attribution import attribute
from elastocal.fitting import fit
from elastocal.loop.case import case_from, noise_from
from elastocal.loop.declared import noise_of
from elastocal.loop.experiment import proposal_frame
from elastocal.loop.intake import taken_in
from elastocal.loop.reading_columns import reading_columns
from elastocal.random_streams import stream


def proposed(folder, robots_folder, verdict, poses, ladder, seed):
    """Poses that best tell what was found in a campaign from its alternatives.

    Parameters
    ----------
    folder, robots_folder : str
        As in `campaign.read_campaign`.
    verdict : dict
        As verdict.json, without faults of the data. What it found is fitted again, not searched for again.
    poses : int
        For each effect that is confounded; read at all targets of the campaign.
    ladder : tuple of float
        Shares of its load at which each is read.
    seed : int

    Returns
    -------
    pandas.DataFrame
        As `proposal_frame`.
    """
    descriptions, training, _ = taken_in(folder, robots_folder)
    case = case_from(descriptions, reading_columns(training))
    final, found = _fitted_again(case, verdict["effects"])
    p_values = {key: effect["p_value"] for effect in verdict["effects"] for key in effect["members"]}
    attributions = attribute(final, found, p_values, case.observations, list(case.candidates.values()))
    draws = stream(seed, case.campaign.name, "next experiment", 0)
    return proposal_frame(case, final, attributions, poses, draws, ladder)


def _fitted_again(case, effects):
    declared = fit(case.model, case.observations, noise_from(noise_of(case)))
    model, found = case.with_found([key for effect in effects for key in effect["members"]])
    values = {entry["name"]: entry["value"] for effect in effects for entry in effect["parameters"]}
    shapes = [np.array([values[f"{candidate.key} {shape.name}"] for shape in candidate.shapes]) for candidate in found]
    start = replace(declared.estimate.with_effects(found), shapes=(*declared.estimate.shapes, *shapes))
    return fit(model, case.observations, declared.noise, start, None, declared.discrepancy_m), found
