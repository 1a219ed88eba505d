"""Rates with their intervals, and options, of the benchmarks that diagnose many simulated
campaigns."""

import argparse
from collections.abc import Iterable

import numpy as np

from elastocal_proof.blind.scores import compute_rate


def format_rate(hits: Iterable[bool]) -> str:
    """Format a share of cases with its Clopper-Pearson interval of 95 %."""
    rate = compute_rate(hits)
    shares = [f"{100 * rate[name]:.2f}" for name in ("rate", "low", "high")]
    return f"{rate['hits']} of {rate['cases']}: {shares[0]} % ({shares[1]}-{shares[2]})"


def format_count_rate(count: int, total: int) -> str:
    """Format the share of `count` in `total` cases, as `format_rate`."""
    return format_rate(np.arange(total) < count)


def make_parser(
    description: str | None, arms: tuple[str, ...]
) -> argparse.ArgumentParser:
    """Make the parser of a benchmark that diagnoses so many campaigns of each robot, from
    a first seed on."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("cases", type=int)
    parser.add_argument("first_seed", type=int)
    parser.add_argument("robots", nargs="*", default=arms)
    parser.add_argument("--each", action="store_true", help="print each campaign too")
    return parser
