"""Steps 2 and 3: the noise of the measurements, and the model as declared."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.least_squares import ON_THE_WAY, fit
from elastocal.fitting.noise import FINEST, Noise, chosen_noise
from elastocal.fitting.registration import registered
from elastocal.fitting.tolerances import SIZES, most_probable, with_size

if TYPE_CHECKING:
    from elastocal.fitting.case import Case

_ASSUMED_M = 1e-4


def estimated_noise(case: Case) -> tuple[Noise, list[str]]:
    """Noise from repeats or as declared, from the residual of the declared model where there is neither; and warnings."""
    start = registered(case.model, case.observations)
    noise, warnings = chosen_noise(case.campaign, case.model, start, case.campaign.measurements)
    if noise is None:
        assumed = Noise("residual", _ASSUMED_M, _ASSUMED_M, np.zeros(case.campaign.robot.joints))
        # The widest prior leaves nearly what none would leave, without parameters that nothing determines.
        model = with_size(case.model, SIZES[-1])
        left = fit(model, case.observations, assumed, start).residual
        typical = [max(float(np.sqrt((part**2).mean())), FINEST) for part in (left[:, :3], left[:, -3:])]
        noise = replace(assumed, position_m=typical[0], orientation_rad=typical[1])
        # What parameters have taken of it is given back.
        wide = fit(model, case.observations, noise, start, settled=ON_THE_WAY)
        noise = noise.scaled(most_probable(wide)[1])
    return noise, warnings
