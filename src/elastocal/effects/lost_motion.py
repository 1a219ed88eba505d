"""Play that the gear crosses where the torque changes its sign: J_i D_i tanh(tau_i / tau_0).

Catalogue row 13. Linear in the play D, not in the torque tau_0 at which it is taken up.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape, per_joint

NAME, FAMILY = "lost_motion", "gearbox"
_PARAMETERS = (Parameter("half_play", "rad", 1e-4),)
_TORQUE = Shape("torque", "N m", 50.0, 5.0, 400.0)


def candidates(sites):
    """One candidate a joint."""

    def at(joint):
        def displacement(circumstances, torque):
            return [{joint: np.tanh(circumstances.load[:, joint] / torque)}]

        return Candidate(NAME, FAMILY, (joint + 1,), "", _PARAMETERS, displacement, frozenset({"load"}), (_TORQUE,))

    return per_joint(sites, at)
