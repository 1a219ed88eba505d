"""Joint compliances that no robot has: negative, or many times off what its data sheet says."""

import numpy as np

# Compliances of a robot and those published for its make differ by up to two or so; five is a unit, a sign or another effect
# that was taken for a joint's.
MOST_OFF_NOMINAL = 5.0


def compliance_warnings(compliance, std_error, nominal):
    """Name the identified joint compliances that are negative, or far off nominal either way.

    Parameters
    ----------
    compliance, std_error : array_like (n,)
        Identified, rad/(N m); standard error 0 where a compliance was not identified.
    nominal : array_like (n,)
        Of the robot file.

    Returns
    -------
    list of str
        One sentence with value and standard error of each, or none.
    """
    compliance, std_error, nominal = (1e6 * np.asarray(values, float) for values in (compliance, std_error, nominal))
    identified = std_error > 0
    negative = identified & (compliance < 0)
    off = (compliance > MOST_OFF_NOMINAL * nominal) | (compliance < nominal / MOST_OFF_NOMINAL)
    named = np.flatnonzero(negative | identified & off & (nominal > 0))
    if not len(named):
        return []
    each = [
        f"joint {joint + 1} {compliance[joint]:.3g} ± {std_error[joint]:.2g} ({_off(compliance[joint], nominal[joint])})"
        for joint in named
    ]
    return [
        f"no such robot has these joint compliances, in µrad/(N·m): {', '.join(each)};"
        " check the sign and the unit of the loads, and whether something else yields too"
    ]


def _off(value, nominal):
    return f"negative, nominal {nominal:.3g}" if value < 0 else f"{value / nominal:.2g} times nominal"
