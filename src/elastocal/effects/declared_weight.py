"""The weight of the links as the robot file declares it, with errors as large as the file says: theta_i = c_i tau_i(q, m).

No NAME, for it is no missing effect: the declared model has it where the robot file has masses. Linear in the error of each
mass and of its first moments m c, which are what statics identifies (Atkeson, An and Hollerbach 1986); a mass takes its
declared centre with it, so that both errors are independent before the data speak.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.robot import Mass
    from elastocal.mechanics.sites import Sites

EFFECT = "declared_weight"
# Links are as wide as a tenth of the arm is long (KUKA KR 270: 0.3 m of 2.7 m); motors and gears put the centre of a slender
# one so far off the line as well.
_WIDTH_OF_LENGTH, _LEAST_OFF_M = 0.1, 0.04


def candidate(sites: Sites) -> Candidate:
    """Errors of all declared masses and first moments as one candidate, each with the prior of the robot file."""

    def displacement(conditions: Conditions) -> Displacements:
        torques = conditions.mass_torques * conditions.compliance
        return [{joint: of_joint for joint, of_joint in enumerate(columns.T) if of_joint.any()} for columns in torques]

    width = _WIDTH_OF_LENGTH * float(np.linalg.norm(sites.link_vectors_m, axis=1).sum())
    parameters = tuple(parameter for mass in sites.masses for parameter in _parameters(mass, width))
    return Candidate(EFFECT, "declared", (), "", parameters, displacement)


def _parameters(mass: Mass, width: float) -> tuple[Parameter, ...]:
    mass_std = mass.relative_std * mass.mass_kg
    # Of a centre that is known as well as its mass is, and may lie anywhere in the girth of its link (uniform distribution).
    moment_std = float(np.hypot(mass_std * np.linalg.norm(mass.centre_m), mass.mass_kg * max(_LEAST_OFF_M, width / 12**0.5)))
    return (
        Parameter(f"mass_error_of_link_{mass.link}", "kg", mass_std, mass_std),
        *(Parameter(f"moment_error_{axis}_of_link_{mass.link}", "kg m", moment_std, moment_std) for axis in "xyz"),
    )
