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


def candidate(sites: Sites) -> Candidate:
    """Compliances of all joints as one candidate."""

    def displacement(conditions: Conditions) -> Displacements:
        return [{joint: conditions.total[:, joint]} for joint in range(sites.joints)]

    sizes = [("m/N", 1e-6) if prismatic else ("rad/(N m)", 1e-5) for prismatic in sites.prismatic]
    parameters = tuple(Parameter(f"c{joint}", unit, size) for joint, (unit, size) in enumerate(sizes, 1))
    return Candidate("joint_compliance", "declared", (), "", parameters, displacement, frozenset({"load"}))
