"""A force that acts elsewhere than was written down: J c J^T (0, dr x F).

Catalogue row 22. The shift dr is fixed in base axes, or in the flange where the load hangs on the tool.
"""

from elastocal.effects.protocol import Parameter
from elastocal.effects.wrench_errors import base_and_flange

NAME, FAMILY = "application_point", "load"
WORDS = "wrong load application point"
_PARAMETERS = tuple(Parameter(f"shift_{axis}", "m", 0.02) for axis in "xyz")


def candidates(sites):
    """One candidate for each frame in which the shift can be fixed."""
    return base_and_flange(NAME, FAMILY, _PARAMETERS, lambda axis, wrench: axis.shift(wrench))
