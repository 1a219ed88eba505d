"""The weight of the links as the robot file declares it, with errors as large as the file says: theta_i = c_i tau_i(q, m).

No NAME, for it is no missing effect: the declared model has it where the robot file has masses. Linear in the error of each
mass and of its first moments m c, which are what statics can tell (Atkeson, An and Hollerbach 1986); a mass takes its declared
centre with it, so that both errors are independent before the data speak.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

EFFECT = "declared_weight"
# A centre of mass near its joint's axis is no better known than this, times its relative error.
_LEAST_DISTANCE_M = 0.1


def candidate(sites):
    """Errors of all declared masses and first moments as one candidate, each with the prior of the robot file."""

    def displacement(circumstances):
        torques = circumstances.mass_torques * circumstances.compliance
        return [{joint: of_joint for joint, of_joint in enumerate(columns.T) if of_joint.any()} for columns in torques]

    parameters = tuple(parameter for mass in sites.masses for parameter in _parameters(mass))
    return Candidate(EFFECT, "declared", (), "", parameters, displacement)


def _parameters(mass):
    mass_std = mass.relative_std * mass.mass_kg
    moment_std = mass_std * max(float(np.linalg.norm(mass.centre_m)), _LEAST_DISTANCE_M)
    return (
        Parameter(f"mass_error_of_link_{mass.link}", "kg", mass_std, mass_std),
        *(Parameter(f"moment_error_{axis}_of_link_{mass.link}", "kg m", moment_std, moment_std) for axis in "xyz"),
    )
