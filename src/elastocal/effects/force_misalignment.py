"""A force sensor that is mounted askew: it shows the right force in a wrong direction.

theta = diag(c) J^T (phi x F, 0), or diag(c) J^T (phi x F, r x (phi x F)) in a pull,

with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, F the recorded
force (N) and phi the small angle from it to the one that acts (rad), fixed in base axes, or in the flange where the sensor
turns with the tool. A sensor in the line of a pull measures the force alone, so that the moment about its lever r (m) is
wrong, too; elsewhere the moments are as recorded. Derived here: a small turn adds phi x F, and an error dw of the wrench loads
by J^T dw.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.sizes import sized
from elastocal.effects.wrench_errors import at_flange_and_in_pull

if TYPE_CHECKING:
    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "force_misalignment", "load"
# The wrench was recorded wrongly; one that is declared for a task is right.
MOVES_ROBOT = False
WORDS = "misalignment of the force sensor"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate for each frame in which the sensor can sit, at the flange and in the pull."""
    parameters = sized(NAME, "turn", [f"about_{axis}" for axis in "xyz"], "rad", sites)
    return at_flange_and_in_pull(NAME, FAMILY, parameters, lambda axis, wrench: axis.turn(wrench))
