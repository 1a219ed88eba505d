"""The whole loop on one campaign in one call, for benchmarks of many campaigns; step by step it is in the pipeline."""

import numpy as np

from elastocal.attribution import attribute, by_effect
from elastocal.fitting import fit
from elastocal.hygiene import faults
from elastocal.law_check import doubts
from elastocal.loop.case import case_from, noise_from
from elastocal.loop.conclude import concluded
from elastocal.loop.declared import noise_of
from elastocal.loop.intake import taken_in
from elastocal.loop.judge import judged, model_steps
from elastocal.loop.reading_columns import reading_columns
from elastocal.random_streams import stream
from elastocal.selection import search


def diagnosed(folder, robots_folder, replicates, seed):
    """Diagnose a campaign.

    Parameters
    ----------
    folder, robots_folder : str
        As in `campaign.read_campaign`.
    replicates : int
        Of the bootstrap behind each look.
    seed : int

    Returns
    -------
    dict
        As verdict.json, without controls.
    """
    descriptions, training, held_out = taken_in(folder, robots_folder)
    case = case_from(descriptions, reading_columns(training))
    unseen = case_from(descriptions["held_out"] or descriptions, reading_columns(held_out))
    known_faults = faults(case.campaign, training)
    facts = noise_of(case)
    noise = noise_from(facts)
    declared = fit(case.model, case.observations, noise)
    everything = list(case.candidates.values())
    candidates = [] if any(fault.decisive for fault in known_faults) else everything
    draws = stream(seed, case.campaign.name, "signs of poses", 0)
    found = search(declared, case.observations, candidates, replicates, draws)
    p_values = {key: float(p_value) for key, (p_value, _, _) in found.chosen.items()}
    attributions = attribute(found.final, found.effects, p_values, case.observations, everything)
    departures = doubts(found.final, found.effects, case.observations)
    groups = {name: list(members) for name, members in by_effect(found.effects).items()}
    result = judged(model_steps(case, noise, declared, found.final, groups, []), case, unseen, seed)
    first = found.looks[0]
    looks = {
        "look": np.zeros(len(first.scores.p_value), int),
        "candidate": np.array([candidate.key for candidate, _ in first.directions.candidates], object),
        "p_value": first.scores.p_value,
    }
    listed = [vars(fault) | {"parameters": [vars(value) for value in fault.parameters]} for fault in known_faults]
    warnings = result.warnings
    return concluded(
        case,
        facts,
        declared,
        found.final,
        attributions,
        [vars(doubt) for doubt in departures],
        looks,
        result.rows,
        result.heldout,
        listed,
        warnings,
        (None, None),
    )
