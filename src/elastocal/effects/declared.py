"""What the declared model has already, as candidates that are no missing effects: its springs, and its weights.

Joint compliance is the reduced model itself, where the compliances are to be identified: each joint a spring, theta_i = c_i
tau_i (equation 7). Declared weight is that of the links where the robot file has masses, with errors as large as the file says:
theta_i = c_i tau_i(q, m), linear in the error of each mass and of its first moments m c, which are what statics identifies
(Atkeson, An and Hollerbach 1986); a mass takes its declared centre with it, so that both errors are independent before the data
speak.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

DECLARED_WEIGHT = "declared_weight"
# Published compliances are up to five times those that suit the size of an arm.
_OVER_USUAL = 10.0
# Links are as wide as a tenth of the arm is long (KUKA KR 270: 0.3 m of 2.7 m); motors and gears put the centre of a slender
# one so far off the line as well.
_WIDTH_OF_LENGTH, _LEAST_OFF_M = 0.1, 0.04


def joint_compliance(sites: Sites) -> Candidate:
    """Compliances of all joints as one candidate."""

    def law(around: Conditions) -> Displacements:
        return [{joint: around.total[:, joint]} for joint in range(sites.joints)]

    units = ["m/N" if prismatic else "rad/(N m)" for prismatic in sites.prismatic]
    sizes = [_OVER_USUAL * compliance for compliance in sites.compliance]
    parameters = tuple(Parameter(f"c{j}", unit, size) for j, (unit, size) in enumerate(zip(units, sizes, strict=True), 1))
    return Candidate("joint_compliance", "declared", (), "", parameters, law, frozenset({"load"}))


def declared_weight(sites: Sites) -> Candidate:
    """Errors of all declared masses and first moments as one candidate, each with the prior of the robot file."""

    def law(around: Conditions) -> Displacements:
        torques = around.mass_torques * around.compliance
        return [{joint: of_joint for joint, of_joint in enumerate(columns.T) if of_joint.any()} for columns in torques]

    width = _WIDTH_OF_LENGTH * float(np.linalg.norm(sites.link_vectors_m, axis=1).sum())
    parameters: list[Parameter] = []
    for mass in sites.masses:
        error = mass.relative_std * mass.mass_kg
        # Of a centre that is known as well as its mass is, and lies anywhere in the girth of its link (uniform distribution).
        of_girth = mass.mass_kg * max(_LEAST_OFF_M, width / 12**0.5)
        moment = float(np.hypot(error * np.linalg.norm(mass.centre_m), of_girth))
        parameters.append(Parameter(f"mass_error_of_link_{mass.link}", "kg", error, error))
        parameters += [Parameter(f"moment_error_{axis}_of_link_{mass.link}", "kg m", moment, moment) for axis in "xyz"]
    return Candidate(DECLARED_WEIGHT, "declared", (), "", tuple(parameters), law)
