"""Shares of cases with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from statsmodels.stats.proportion import proportion_confint

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def rate(hits: Iterable[bool]) -> dict[str, float]:
    """A share with its Clopper-Pearson interval [1] of 95 %.

    `hits`: one a case. Returns ``hits``, ``cases``, ``rate``, ``low``, ``high``; without cases the rate is not a number and the
    interval all there is.

    [1] Clopper, C. J. and Pearson, E. S., The use of confidence or fiducial limits illustrated in the case of the binomial,
        Biometrika 26, 1934.
    """
    hits = [bool(hit) for hit in hits]
    count, cases = sum(hits), len(hits)
    low, high = proportion_confint(count, cases, 0.05, "beta") if cases else (0.0, 1.0)
    return {
        "hits": count,
        "cases": cases,
        "rate": count / cases if cases else float("nan"),
        "low": 0.0 if count == 0 else float(low),
        "high": 1.0 if count == cases else float(high),
    }


def headed(head: str, found: Mapping[str, float]) -> dict[str, float]:
    """The figures of a rate under a name: ``<head>``, ``<head>_low``, ``<head>_high``."""
    return {head: found["rate"], f"{head}_low": found["low"], f"{head}_high": found["high"]}
