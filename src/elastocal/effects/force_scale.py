"""A force sensor that shows too much or too little: its sensitivity differs from the one of its calibration.

theta = diag(c) J^T (s w), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the
loaded point, w the recorded wrench (N, N m) and s the share by which the one that acts is larger. Derived here: the error s w
of the wrench loads the joints by J^T (s w). Where all compliances are identified and no declared masses load the joints it is
exactly an alias of them, so that only a reference weight can find it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import LOADED_JOINTS, Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "force_scale", "load"
# The wrench was recorded wrongly; one that is declared for a task is right.
MOVES_ROBOT = False
WORDS = "scale error of the force sensor"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate."""
    parameters = sized(NAME, "scale", ["scale"], "1", sites)

    def displacement(conditions: Conditions) -> Displacements:
        return [dict(enumerate(conditions.joint_deflections(conditions.wrench).T))]

    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, LOADED_JOINTS)]
