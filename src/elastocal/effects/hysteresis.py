"""Friction and backlash that hold a joint back on the side from which it came: J_i h_i s_i, s_i the sense of approach.

Catalogue row 14. Where the approach is not recorded this is part of the repeatability.
"""

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "hysteresis", "gearbox"
WORDS = "hysteresis"
# The nut of a spindle has some hundredths of a millimetre.
_TURN, _SHIFT = Parameter("half_width", "rad", 1e-4), Parameter("half_width", "m", 2e-5)


def candidates(sites):
    """One candidate a joint."""

    def at(joint):
        def displacement(conditions):
            return [{joint: conditions.approach[:, joint]}]

        parameter = _SHIFT if sites.prismatic[joint] else _TURN
        return Candidate(NAME, FAMILY, (joint + 1,), "", (parameter,), displacement, frozenset({"approach"}))

    return per_joint(sites, at, prismatic=True)
