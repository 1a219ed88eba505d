"""A force sensor that shows too much or too little: its sensitivity differs from the one of its calibration.

theta = diag(c) J^T (s w), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the
loaded point, w the recorded wrench (N, N m) and s the share by which the one that acts is larger. Derived here: the error s w
of the wrench loads the joints by J^T (s w). Where all compliances are identified and no declared masses load the joints it is
exactly an alias of them, so that only a reference weight can find it.
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
