"""The reduced model itself: each joint a spring, theta_i = c_i tau_i (equation 7).

No NAME, for it is no missing effect: the declared model has it where the compliances are to be identified.
"""

from elastocal.effects.protocol import Candidate, Parameter


def candidate(sites):
    """Compliances of all joints as one candidate."""

    def displacement(conditions):
        return [{joint: conditions.total[:, joint]} for joint in range(sites.joints)]

    sizes = [("m/N", 1e-6) if prismatic else ("rad/(N m)", 1e-5) for prismatic in sites.prismatic]
    parameters = tuple(Parameter(f"c{joint}", unit, size) for joint, (unit, size) in enumerate(sizes, 1))
    return Candidate("joint_compliance", "declared", (), "", parameters, displacement, frozenset({"load"}))
