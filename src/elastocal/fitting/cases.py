"""Campaigns made ready to be fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from elastocal.campaigns.campaign import assemble_campaign, build_measurements
from elastocal.effects.catalogue import candidates_on, declared_candidates
from elastocal.fitting.model import Case, build_declared_model
from elastocal.fitting.noise import estimate_shaped_noise
from elastocal.fitting.observations import average_repeats, remove_outlying_repeats
from elastocal.mechanics.robot_file import parse_robot
from elastocal.mechanics.sites import build_sites

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

    from elastocal.campaigns.campaign import Campaign


def build_case(
    descriptions: Mapping[str, Any], columns: Mapping[str, np.ndarray]
) -> Case:
    """Build a case from the description of a campaign and its measurements table.

    `descriptions` is as step 1 of the pipeline writes it, `columns` are those of the
    table.
    """
    source = descriptions["source"]
    robot = parse_robot(descriptions["robot"], source)
    campaign = assemble_campaign(
        descriptions["campaign"], robot, build_measurements(columns), source
    )
    return prepare_case(campaign, source)


def prepare_case(campaign: Campaign, source: str) -> Case:
    """Prepare the fit of a campaign; `source` is its file, for messages."""
    sites = build_sites(campaign.robot)
    model = build_declared_model(
        campaign, declared_candidates(campaign.declared, sites, source)
    )
    candidates = {
        key: candidate
        for key, candidate in candidates_on(model.sites).items()
        if candidate.effect not in campaign.declared
    }
    case = Case(
        campaign,
        average_repeats(remove_outlying_repeats(campaign.measurements)),
        model,
        candidates,
    )
    shaped = estimate_shaped_noise(case)
    return (
        case
        if shaped is None
        else replace(case, model=replace(model, shaped_noise=shaped))
    )
