"""A force sensor that is mounted askew: the force turned by a small angle phi, J c J^T (phi x F).

Catalogue row 20. The angle is fixed in base axes, or in the flange where the sensor turns with the tool. A sensor in the line
of a pull tells the force alone, so that the moment that this makes at its lever is wrong, too.
"""

from elastocal.effects.protocol import Parameter
from elastocal.effects.wrench_errors import at_flange_and_in_pull

NAME, FAMILY = "force_misalignment", "load"
WORDS = "misalignment of the force sensor"
_PARAMETERS = tuple(Parameter(f"about_{axis}", "rad", 0.02) for axis in "xyz")


def candidates(sites):
    """One candidate for each frame in which the sensor can sit, at the flange and in the pull."""
    return at_flange_and_in_pull(NAME, FAMILY, _PARAMETERS, lambda axis, wrench: axis.turn(wrench))
