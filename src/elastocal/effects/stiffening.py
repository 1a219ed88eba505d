"""A gear that gets stiffer with torque: J_i k3_i tau_i^3.

Catalogue row 12.
"""

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "stiffening", "gearbox"
_PARAMETERS = (Parameter("cubic", "rad/(N m)^3", 1e-11),)


def candidates(sites):
    """One candidate a joint."""

    def at(joint):
        def displacement(circumstances):
            return [{joint: circumstances.load[:, joint] ** 3}]

        return Candidate(NAME, FAMILY, (joint + 1,), "", _PARAMETERS, displacement, frozenset({"load"}))

    return per_joint(sites, at)
