"""Links that grow as they warm up: alpha dT along each link.

Catalogue row 18. With a measured temperature dT is its change from the first state; with the time alone it is the rise of a
first order lag, 1 - exp(-t / t_0).
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape

NAME, FAMILY = "thermal_growth", "drift"
_LAG = Shape("lag", "s", 3600.0, 300.0, 36000.0)


def candidates(sites):
    """One candidate by temperature and one by time."""

    def grown(rise):
        links = range(1, sites.joints + 1)
        return {
            coordinate: rise * along
            for link in links
            for coordinate, along in zip(sites.link_end[link][:3], sites.link_vectors_m[link], strict=True)
            if along
        }

    def by_temperature(circumstances):
        return [grown(circumstances.temperature_c - circumstances.temperature_c[0])]

    def by_time(circumstances, lag):
        return [grown(-np.expm1(-(circumstances.time_s - circumstances.time_s.min()) / lag))]

    coefficient, growth = Parameter("expansion", "1/K", 3e-5), Parameter("final_growth", "m/m", 3e-4)
    return [
        Candidate(NAME, FAMILY, (), "temperature", (coefficient,), by_temperature, frozenset({"temperature"})),
        Candidate(NAME, FAMILY, (), "time", (growth,), by_time, frozenset({"time"}), (_LAG,)),
    ]
