"""Faults of the data, looked for before any physics."""

from elastocal.faults.catalogue import known_faults


def faults(campaign, readings):
    """Every fault that some readings show.

    Parameters
    ----------
    campaign : Campaign
    readings : Readings

    Returns
    -------
    tuple of Fault
        A fault is not looked for where another one makes that meaningless: see `faults.protocol`.
    """
    found = []
    for module in known_faults().values():
        if not {fault.name for fault in found} & set(module.AFTER):
            found += module.find(campaign, readings)
    return tuple(found)
