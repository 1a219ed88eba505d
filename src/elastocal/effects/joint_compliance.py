"""The reduced model itself: each joint a spring, theta_i = c_i tau_i (equation 7).

No NAME, for it is no missing effect: the declared model has it where the compliances are to be identified.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, Parameter

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

# Published compliances are up to five times those that suit the size of an arm.
_OVER_USUAL = 10.0


def candidate(sites: Sites) -> Candidate:
    """Compliances of all joints as one candidate."""

    def displacement(conditions: Conditions) -> Displacements:
        return [{joint: conditions.total[:, joint]} for joint in range(sites.joints)]

    units = ["m/N" if prismatic else "rad/(N m)" for prismatic in sites.prismatic]
    sizes = [_OVER_USUAL * compliance for compliance in sites.compliance]
    parameters = tuple(Parameter(f"c{j}", unit, size) for j, (unit, size) in enumerate(zip(units, sizes, strict=True), 1))
    return Candidate("joint_compliance", "declared", (), "", parameters, displacement, frozenset({"load"}))
