"""Measure how often 95 % intervals of held-out errors contain the true value.

Run `python benchmarks/interval_coverage.py`, two minutes.

Prints the table of docs/held_out_intervals.md; `--draw PAGE` draws the table of that
page beside it instead.
"""

import argparse
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from made_errors import KINDS, campaigns_of, true_figures
from scipy.stats import bootstrap

from elastocal.figures.style import PALETTE, create_panels, styled
from elastocal.validation.held_out import PositionErrors, compute_error_intervals

POSES = (9, 18, 36)
REPLICATES = 999
FIGURES = ("mean_m", "rms_m", "reduction", "reduction of none")
METHODS = ("percentile", "BCa", "ours")
# Names of the methods and of the kinds of errors in the picture.
_NAMES = {
    "percentile": "percentile bootstrap",
    "BCa": "BCa bootstrap",
    "ours": "elastocal (bootstrap-t)",
}
_TITLES = {
    "common": "errors common\nto a pose",
    "uneven": "the same, uneven\nmeasurements",
    "skewed": "skewed errors\nof poses",
    "far off": "one pose in 20\nfour times off",
}


def main() -> None:
    """Print one line for each kind of errors and number of poses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--campaigns", type=int, default=400, help="number in each line"
    )
    parser.add_argument("--draw", type=Path, help="a page whose table is drawn")
    given = parser.parse_args()
    if given.draw:
        return draw(given.draw)
    campaigns = given.campaigns
    print(
        "| errors | poses |"
        + "|".join(f" {name.removesuffix('_m')} " for name in FIGURES)
        + "|"
    )
    print("|---" * (2 + len(FIGURES)) + "|")
    for kind in KINDS:
        truth = true_figures(kind)
        for poses in POSES:
            coverage = compute_coverage(kind, poses, campaigns, truth)
            cells = []
            for name in FIGURES:
                shares = [f"{100 * coverage[name, method]:.0f}" for method in METHODS]
                cells.append(" / ".join(shares))
            print(f"| {kind} | {poses} | " + " | ".join(cells) + " |", flush=True)


@styled
def draw(page: Path) -> None:
    """Draw the coverage of the intervals of the RMS error from the table of a page."""
    lines = [
        line.strip("| \n").split(" | ")
        for line in page.read_text(encoding="utf-8").splitlines()
        if " / " in line
    ]
    figure, axes = create_panels(1, len(KINDS), 64, sharey=True)
    for axis, kind in zip(axes[0], KINDS, strict=True):
        rows = [line for line in lines if line[0] == kind]
        cells = [row[2 + FIGURES.index("rms_m")] for row in rows]
        values = np.array([cell.split(" / ") for cell in cells], float)
        for column, method in enumerate(METHODS):
            name = _NAMES[method]
            axis.plot(
                [int(row[1]) for row in rows],
                values[:, column],
                "o-",
                color=PALETTE[2 - column],
                ms=4,
                label=name,
            )
        axis.axhline(95, color="black", lw=0.8, ls=":", label="nominal: 95 %")
        axis.set(title=_TITLES[kind], xlabel="held-out poses", xticks=POSES)
    axes[0, 0].set_ylabel("intervals with\nthe true value (%)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4
    )
    figure.savefig(page.with_suffix(".png"), metadata={"Software": None}, dpi=150)


def compute_coverage(
    kind: str, poses: int, campaigns: int, truth: Mapping[str, float]
) -> dict[tuple[str, str], float]:
    """Compute the share of campaigns whose interval contains the true value."""
    rng = np.random.default_rng(7)
    hits = {}
    for before, after, false in campaigns_of(kind, campaigns, poses, (8, poses)):
        intervals = {
            method: compute_by_scipy(before, after, false, method, rng)
            for method in METHODS[:2]
        }
        limits, reductions = compute_error_intervals([before, after], REPLICATES, rng)
        of_none = compute_error_intervals([after, false], REPLICATES, rng)[1][1]
        ours = {name: limits[1][name] for name in FIGURES[:2]}
        ours |= {
            "reduction": (reductions[1].low, reductions[1].high),
            "reduction of none": (of_none.low, of_none.high),
        }
        for method, limits_of_method in (intervals | {"ours": ours}).items():
            for name, (low, high) in limits_of_method.items():
                hits[name, method] = hits.get((name, method), 0) + (
                    low <= truth[name] <= high
                )
    return {key: count / campaigns for key, count in hits.items()}


def compute_by_scipy(
    before: PositionErrors,
    after: PositionErrors,
    false: PositionErrors,
    method: str,
    rng: np.random.Generator,
) -> dict[str, np.ndarray]:
    """Compute the same intervals by `scipy.stats.bootstrap` over poses."""
    cluster = after.cluster
    counts = np.bincount(cluster)
    sums = np.bincount(cluster, after.distance)
    squares = [
        np.bincount(cluster, errors.distance**2) for errors in (before, after, false)
    ]

    def ratio(top: np.ndarray, bottom: np.ndarray, axis: int = -1) -> np.ndarray:
        return top.sum(axis=axis) / bottom.sum(axis=axis)

    def interval(
        samples: tuple[np.ndarray, ...], statistic: Callable[..., np.ndarray]
    ) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = bootstrap(
                samples,
                statistic,
                paired=True,
                vectorized=True,
                n_resamples=REPLICATES,
                method=method,
                rng=rng,
            )
        return np.array(result.confidence_interval)

    return {
        "mean_m": interval((sums, counts), ratio),
        "rms_m": np.sqrt(interval((squares[1], counts), ratio)),
        "reduction": 1 - np.sqrt(interval((squares[1], squares[0]), ratio))[::-1],
        "reduction of none": 1
        - np.sqrt(interval((squares[2], squares[1]), ratio))[::-1],
    }


if __name__ == "__main__":
    main()
