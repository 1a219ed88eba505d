"""A force sensor that is mounted askew: the force turned by a small angle phi, J c J^T (phi x F).

Catalogue row 20. The angle is fixed in base axes, or in the flange where the sensor turns with the tool.
"""

from elastocal.effects.protocol import Parameter
from elastocal.effects.wrench_errors import base_and_flange

NAME, FAMILY = "force_misalignment", "load"
WORDS = "misalignment of the force sensor"
_PARAMETERS = tuple(Parameter(f"about_{axis}", "rad", 0.02) for axis in "xyz")


def candidates(sites):
    """One candidate for each frame in which the sensor can sit."""
    return base_and_flange(NAME, FAMILY, _PARAMETERS, lambda axis, wrench: axis.turn(wrench))
