"""Faults of the data, looked for before any physics."""

from elastocal.faults.catalogue import fault_modules


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
    found, decisive = [], set()
    for name, module in fault_modules().items():
        if decisive & set(module.AFTER):
            continue
        new = module.find(campaign, readings)
        found += new
        if any(fault.decisive for fault in new):
            decisive.add(name)
    return tuple(found)
