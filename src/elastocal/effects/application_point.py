"""A force that acts elsewhere than was recorded: the pull or the weight is fixed to the tool at another place.

theta = diag(c) J^T (0, dr x F), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of
the loaded point, F the force (N) and dr the shift of its point of application (m), fixed in base axes, or in the flange where
the load hangs on the tool. Derived here: a force that is moved by dr has the further moment dr x F, and a wrench w loads the
joints by J^T w.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.sizes import sized
from elastocal.effects.wrench_errors import base_and_flange

if TYPE_CHECKING:
    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "application_point", "load"
# The wrench was recorded wrongly; one that is declared for a task is right.
MOVES_ROBOT = False
WORDS = "wrong load application point"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate for each frame in which the shift can be fixed."""
    parameters = sized(NAME, "shift", [f"shift_{axis}" for axis in "xyz"], "m", sites)
    return base_and_flange(NAME, FAMILY, parameters, lambda axis, wrench: axis.shift(wrench))
