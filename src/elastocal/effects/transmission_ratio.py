"""Wrong ratio of a gear, or coupling from the joint before it: theta_i = e_i q_i + e_ih q_h, h = i - 1.

Catalogue row 17, kinematic part: linear in the angle and not periodic.
"""

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "transmission_ratio", "transmission"


def candidates(sites):
    """One candidate a joint."""

    def at(joint):
        sources = [source for source in (joint, joint - 1) if source >= 0]
        parameters = tuple(Parameter(f"per_q{source + 1}", "rad/rad", 1e-3) for source in sources)

        def displacement(circumstances):
            return [{joint: circumstances.joint_angles[:, source]} for source in sources]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement)

    return per_joint(sites, at)
