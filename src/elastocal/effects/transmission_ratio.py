"""Wrong ratio of a gear, or coupling from a joint before it: theta_i = e_i q_i + e_ih q_h.

Catalogue row 17, kinematic part: linear in the angle and not periodic. Any joint may be coupled to the one before it. In a
wrist whose last two motors sit in the forearm and drive through hollow shafts both follow the first wrist joint: the last one
is coupled to the joint two before it.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "transmission_ratio", "transmission"
WORDS = "gear ratio or coupling error"
_WRIST = 3


def candidates(sites):
    """One candidate a joint, and each of the last two joints as driven through the first of the wrist alone."""
    n, first = sites.joints, sites.joints - _WRIST
    own = [_candidate(sites, joint, [joint, joint - 1][: joint + 1], "") for joint in range(n)]
    through = [joint for joint in (n - 2, n - 1) if first >= 0 and not any(sites.prismatic[first:])]
    return [*own, *(_candidate(sites, joint, [first], f"from {first + 1}") for joint in through)]


def _candidate(sites, joint, sources, detail):
    # A spindle has a pitch of its own, but is not coupled to what turns.
    alike = [source for source in sources if sites.prismatic[source] == sites.prismatic[joint]]
    unit = "m/m" if sites.prismatic[joint] else "rad/rad"
    parameters = tuple(Parameter(f"per_q{source + 1}", unit, 1e-3) for source in alike)

    def displacement(conditions):
        return [{joint: conditions.joint_angles[:, source]} for source in alike]

    return Candidate(NAME, FAMILY, (joint + 1,), detail, parameters, displacement)
