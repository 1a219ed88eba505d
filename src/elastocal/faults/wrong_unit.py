"""Loads in another unit than newtons and newton metres.

Positions in millimetres and angles in degrees are refused by the reader; a load has no size that is absurd in itself. Only the
compliances tell: all joints give way by the same factor more, or less, than nominally. One between a half and two is nobody's
unit.
"""

from elastocal.faults.deflections import deflections, unit_of_loads
from elastocal.faults.protocol import Fault, Value

NAME, FAMILY, AFTER = "wrong_unit", "data", ()


def find(campaign, readings):
    """The unit in which the loads explain the readings, where it is not the one that they must have.

    Parameters
    ----------
    campaign : Campaign
    readings : Readings

    Returns
    -------
    list of Fault
    """
    bent = deflections(campaign, readings)
    found = unit_of_loads(bent) if bent else None
    if found is None or not found.unit.detail:
        return []
    parameters = (
        Value("newtons for each unit of force written", found.unit.force, "N"),
        Value("newton metres for each unit of moment written", found.unit.moment, "N m"),
        Value("deflection over the one expected", found.slope, "–"),
    )
    return [Fault(NAME, (), found.unit.detail, parameters, (found.rms_as_written, found.rms_corrected), (), True)]
