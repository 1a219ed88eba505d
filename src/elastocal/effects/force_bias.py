"""A force sensor that shows a force where there is none: its zero was not set before the pull, or has moved since.

theta = diag(c) J^T (b, 0) wherever a load is recorded, or (b, r x b) in a pull with the lever r (m); theta are the turns of
the joints (rad), c their compliances (rad/(N m)), J the Jacobian of the loaded point, and b the force that acts beyond the
recorded one (N), which is minus what the sensor shows at zero. It is fixed in base axes, or in the flange where the sensor
turns with the tool. Derived here: a wrench w loads the joints by J^T w, so that its error dw turns them by diag(c) J^T dw.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.sizes import sized
from elastocal.effects.wrench_errors import at_flange_and_in_pull

if TYPE_CHECKING:
    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "force_bias", "load"
# The wrench was recorded wrongly; one that is declared for a task is right.
MOVES_ROBOT = False
WORDS = "zero error of the force sensor"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate for each frame in which the sensor can sit."""
    parameters = sized(NAME, "force", [f"along_{axis}" for axis in "xyz"], "N", sites)
    return at_flange_and_in_pull(NAME, FAMILY, parameters, lambda axis, wrench: axis.push(wrench))
