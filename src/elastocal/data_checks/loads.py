"""Loads turned round, or in another unit than newtons and newton metres.

A load has no size that is absurd in itself. Only the compliances tell: all joints give way by the same factor more, or less,
than nominally. One between a third and three is nobody's unit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.data_checks.deflections import deflections, unit_of_loads
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements

NAMES, FAMILY, AFTER = ("wrong_sign", "wrong_unit"), "data", ("constant_columns", "alternatives")


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Sign and unit in which the loads explain the measurements, where they are not those that they must have.

    None where the compliances are not known: no size of a deflection is to be expected then.
    """
    if not campaign.robot.compliance_known:
        return []
    deflected = deflections(campaign, measurements)
    found = unit_of_loads(deflected) if deflected else None
    if found is None:
        return []
    evidence, faults = (found.rms_as_written, found.rms_corrected), []
    slope = Value("deflection over the one expected", found.slope, "–")
    if found.sign < 0:
        detail = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
        faults.append(Fault("wrong_sign", (), detail, (slope,), evidence, (), True))
    if found.unit.detail:
        parameters = (
            Value("newtons for each unit of force written", found.unit.force, "N"),
            Value("newton metres for each unit of moment written", found.unit.moment, "N m"),
            slope,
        )
        other = found.less_likely
        detail = found.unit.detail if other is None else f"{found.unit.detail}; less likely, {other.detail}"
        faults.append(Fault("wrong_unit", (), detail, parameters, evidence, (), True))
    return faults
