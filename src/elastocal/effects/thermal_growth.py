"""Column and links that grow as they warm up: alpha dT along each.

Catalogue row 18. With a measured temperature dT is counted from 20 °C, at which dimensions are stated (ISO 1); with the time
alone it is the rise of a first order lag since the campaign began, 1 - exp(-t / t_0).
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape

NAME, FAMILY = "thermal_growth", "drift"
WORDS = "thermal growth of the links"
_REFERENCE_C = 20.0
_LAG = Shape("lag", "s", 3600.0, 300.0, 36000.0)


def candidates(sites):
    """One candidate by temperature and one by time."""

    def grown(rise):
        return {
            coordinate: rise * along
            for link in range(sites.joints + 1)
            for coordinate, along in zip(sites.link_end[link][:3], sites.link_vectors_m[link], strict=True)
            if along
        }

    def by_temperature(circumstances):
        return [grown(circumstances.temperature_c - _REFERENCE_C)]

    def by_time(circumstances, lag):
        return [grown(-np.expm1(-circumstances.time_s / lag))]

    coefficient, growth = Parameter("expansion", "1/K", 3e-5, sign=1), Parameter("final_growth", "m/m", 3e-4)
    return [
        Candidate(NAME, FAMILY, (), "temperature", (coefficient,), by_temperature, frozenset({"temperature"})),
        Candidate(NAME, FAMILY, (), "time", (growth,), by_time, frozenset({"time"}), (_LAG,)),
    ]
