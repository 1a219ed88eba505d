"""A force sensor that shows too much or too little: J c J^T (s w).

Catalogue row 19: an exact alias of the compliances, so that where they are identified only a reference weight can find it.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "force_scale", "load"
WORDS = "scale error of the force sensor"
_PARAMETERS = (Parameter("scale", "1", 0.02),)


def candidates(sites):
    """One candidate."""

    def displacement(conditions):
        return [dict(enumerate(conditions.joint_deflections(conditions.wrench).T))]

    return [Candidate(NAME, FAMILY, (), "", _PARAMETERS, displacement, frozenset({"load"}))]
