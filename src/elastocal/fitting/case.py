"""What every step needs of a campaign, put together again from its tables."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import Campaign, assemble_campaign, measurements_from
from elastocal.effects.catalogue import candidates_on, declared_candidates
from elastocal.fitting.model import Model, declared_model
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import Observations, averaged, without_outlying_repeats
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.sites import sites_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.effects.protocol import Candidate


@dataclass(frozen=True)
class Case:
    """A campaign ready to be fitted.

    `campaign`: its measurements are those to fit. `observations`: their repeats averaged, without the outlying ones. `model`:
    as declared. `candidates`: everything that the model might lack.
    """

    campaign: Campaign
    observations: Observations
    model: Model
    candidates: dict[str, Candidate]

    def select(self, kept: np.ndarray) -> Case:
        """The same without some of the measurements; ndarray of bool (N,)."""
        some = replace(self.campaign, measurements=self.campaign.measurements.select(kept))
        return replace(self, campaign=some, observations=averaged(without_outlying_repeats(some.measurements)))


def case_from(descriptions: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> Case:
    """Put a campaign together.

    `descriptions`: with ``campaign`` and ``robot``, as step 1 writes them. `columns`: of the measurements table.
    """
    source = descriptions["source"]
    robot = robot_from_document(descriptions["robot"], source)
    campaign = assemble_campaign(descriptions["campaign"], robot, measurements_from(columns), source)
    sites = sites_of(campaign.robot)
    model = declared_model(campaign, declared_candidates(campaign.declared, sites, source))
    candidates = {key: c for key, c in candidates_on(sites).items() if c.effect not in campaign.declared}
    return Case(campaign, averaged(without_outlying_repeats(campaign.measurements)), model, candidates)


def noise_facts(noise: Noise) -> dict[str, Any]:
    """Noise as a JSON document."""
    return asdict(noise) | {"joint_rad": noise.joint_rad.tolist()}


def noise_from(facts: Mapping[str, Any]) -> Noise:
    """Noise from its JSON document, or from a verdict, which tells more of it."""
    known = {entry.name: facts["noise"][entry.name] for entry in fields(Noise)}
    return Noise(**known | {"joint_rad": np.array(known["joint_rad"])})
