"""Wrong ratio of a gear, or coupling from a joint before it: theta_i = e_i q_i + e_ih q_h.

Catalogue row 17, kinematic part: linear in the angle and not periodic. Any joint may be coupled to the one before it. In a
wrist whose last two motors sit in the forearm and drive through hollow shafts both follow the first wrist joint (Spong,
Hutchinson and Vidyasagar 2006, 3.3): the last one from two joints before it.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "transmission_ratio", "transmission"
WORDS = "gear ratio or coupling error"
_WRIST = 3


def candidates(sites):
    """One candidate a joint, and each of the last two joints as driven through the first of the wrist alone."""
    n = sites.joints
    own = [_candidate(joint, [source for source in (joint, joint - 1) if source >= 0], "") for joint in range(n)]
    first = n - _WRIST
    return own if first < 0 else [*own, *(_candidate(joint, [first], f"from {first + 1}") for joint in (n - 2, n - 1))]


def _candidate(joint, sources, detail):
    parameters = tuple(Parameter(f"per_q{source + 1}", "rad/rad", 1e-3) for source in sources)

    def displacement(circumstances):
        return [{joint: circumstances.joint_angles[:, source]} for source in sources]

    return Candidate(NAME, FAMILY, (joint + 1,), detail, parameters, displacement)
