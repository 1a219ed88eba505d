"""Tables of the research questions beyond the paper's strategies."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from elastocal.study.budget_tables import MICRO, ratio_of_roots, root_mean
from elastocal.study.designs import RANDOM
from elastocal.study.observability import INDICES
from elastocal.study.tables import find_statistics

CHOSEN = "by cross-validation"
MILLI = 1e3


def ladder_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Error of one data set on configurations that it has not seen, by number of link springs.

    `frames`: the ladder table of each robot with links. Returns robot, noise_um, length, link_springs (a number, or `CHOSEN`),
    rms_um with its standard error, chosen_percent: share of data sets in which cross-validation stops there, and usual_link:
    the link added most often at this step, from 1.
    """
    rows: list[dict[str, Any]] = []
    for robot, frame in frames.items():
        for (noise, length), cell in frame.groupby(["noise", "length"]):
            head = {"robot": robot, "noise_um": round(MICRO * float(str(noise)), 6), "length": length}
            steps = [(str(number), some) for number, some in cell.groupby("link_springs")]
            for name, some in [*steps, (CHOSEN, cell[cell.chosen])]:
                rms, error = root_mean(some.mean_square.to_numpy())
                row: dict[str, Any] = {"link_springs": name, "rms_um": MICRO * rms, "rms_um_std_error": MICRO * error}
                row["chosen_percent"] = 100 * some.chosen.mean() if name != CHOSEN else np.nan
                row["usual_link"] = int(some.added_link.mode().iloc[0]) if name not in ("0", CHOSEN) else pd.NA
                rows.append(head | row)
    names = ("robot", "noise_um", "length", "link_springs", "rms_um", "rms_um_std_error", "chosen_percent", "usual_link")
    return pd.DataFrame(rows, columns=[*names])


def designs_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Random against optimal configurations.

    `frames`: the designs table of each robot. Returns robot, joint_range, design, configurations, rms_um, low_um and high_um: 5
    and 95 % of random designs.
    """
    frame = _of_all_robots(frames)
    errors = (MICRO * frame[["rms", "low", "high"]]).add_suffix("_um")
    return frame[["robot", "joint_range", "design", "configurations"]].join(errors)


def observability_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """How well an observability index of random configurations tells their worth, by rank correlation.

    `frames`: the observability table of each robot. Returns robot, index (the bound among them), rank_correlation_with_bound
    and rank_correlation_with_error, each with its standard error by a normal approximation; -1 where a larger index always
    means a smaller error.
    """
    from scipy.stats import spearmanr

    rows = []
    for (robot, frame), index in product(frames.items(), (*INDICES, "bound")):
        row: dict[str, Any] = {"robot": robot, "index": index}
        for name, against in (("bound", "bound"), ("error", "mean_square")):
            found = float(spearmanr(frame[index], frame[against]).statistic)
            row[f"rank_correlation_with_{name}"] = found
            row[f"rank_correlation_with_{name}_std_error"] = (1 - found**2) / np.sqrt(len(frame) - 1)
        rows.append(row)
    return pd.DataFrame(rows)


def geometry_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Geometry and compliances together, one after the other, or alone.

    `frames`: the geometry table of each robot. Returns robot, estimator, rms_um and its parts noise_um and leak_um,
    compliance_noise_percent, compliance_leak_percent, zero_noise_urad, zero_leak_urad.
    """
    frame = _of_all_robots(frames)
    part = frame[["robot", "estimator"]].assign(rms_um=MICRO * np.hypot(frame.noise, frame.leak))
    part = part.join((MICRO * frame[["noise", "leak"]]).add_suffix("_um"))
    part = part.join(frame[["compliance_noise", "compliance_leak"]].add_suffix("_percent"))
    return part.join((MICRO * frame[["zero_noise", "zero_leak"]]).add_suffix("_urad"))


def weighting_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """What equal weights cost.

    `frames`: the weighting table of each robot. Returns robot, orientation_ratio, per_metre_um, equal_um, weighted_um, ratio.
    """
    frame = _of_all_robots(frames)
    part = frame[["robot", "orientation_ratio"]].join((MICRO * frame[["per_metre", "equal", "weighted"]]).add_suffix("_um"))
    return part.assign(ratio=frame.equal / frame.weighted)


def places_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """A second target at each place of the arm, against the end-effector in twice as many configurations.

    `frames`: the places table of each robot. Returns robot, joints, along_m, side, ratio of the bounds at as many measurements
    with its 95 % interval, ratio_low and ratio_high; seen_turned_percent and seen_fixed_percent: configurations in which a
    tracker sees the target.
    """
    rows: list[dict[str, Any]] = []
    for robot, frame in frames.items():
        for (joints, along, side), cell in frame.groupby(["joints", "along", "side"], sort=False):
            ratio, low, high = ratio_of_roots(cell.bound.to_numpy(), cell.bound_end_effector.to_numpy())
            row: dict[str, Any] = {"robot": robot, "joints": joints, "along_m": along, "side": side}
            row |= {"ratio": ratio, "ratio_low": low, "ratio_high": high}
            for name in ("turned", "fixed"):
                row[f"seen_{name}_percent"] = 100 * cell[name].mean()
            rows.append(row)
    return pd.DataFrame(rows)


def tubes_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Deflections before calibration in single data sets, and what joint springs alone leave, by the diameter of the tubes.

    `frames`: the tubes table of each robot with links. Returns robot, diameter_mm; mean_mm, std_mm and max_mm of single data
    sets, each with the standard deviation between data sets (mean_mm_between ...); left_um with its standard error.
    """
    rows: list[dict[str, Any]] = []
    for robot, frame in frames.items():
        for diameter, cell in frame.groupby("diameter", sort=False):
            row: dict[str, Any] = {"robot": robot, "diameter_mm": MILLI * float(str(diameter))}
            for name, values in find_statistics(cell).items():
                row |= {f"{name}_mm": MILLI * values.mean(), f"{name}_mm_between": MILLI * values.std(ddof=1)}
            left, error = root_mean(cell.left.to_numpy())
            rows.append(row | {"left_um": MICRO * left, "left_um_std_error": MICRO * error})
    names = ["robot", "diameter_mm", *(f"{name}_mm{more}" for name in ("mean", "std", "max") for more in ("", "_between"))]
    return pd.DataFrame(rows, columns=[*names, "left_um", "left_um_std_error"])


def few_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Error of one data set of few configurations, with and without what a data sheet knows.

    `frames`: the few table of each robot. Returns robot, nominal_error_percent, strategy, configurations, rms_um with its
    standard error, median_um; empty where the configurations do not determine the compliances.
    """
    rows: list[dict[str, Any]] = []
    for robot, frame in frames.items():
        for (error, strategy, length), cell in frame.groupby(["nominal_error", "strategy", "length"], sort=False):
            rms, spread = root_mean(cell.mean_square.to_numpy())
            row: dict[str, Any] = {"robot": robot, "nominal_error_percent": 100 * float(str(error)), "strategy": strategy}
            row |= {"configurations": length, "rms_um": MICRO * rms, "rms_um_std_error": MICRO * spread}
            rows.append(row | {"median_um": MICRO * np.sqrt(cell.mean_square.median(skipna=False))})
    names = ("robot", "nominal_error_percent", "strategy", "configurations", "rms_um", "rms_um_std_error", "median_um")
    return pd.DataFrame(rows, columns=[*names])


def kinds_table(frames: Mapping[str, pd.DataFrame], length: int) -> pd.DataFrame:
    """Error of one data set by what is measured: in as many configurations, and with as many scalar measurements.

    `frames`: the kinds table of each robot. `length`: configurations; the scalars are those of poses in so many. Returns
    robot, kind, scalars_per_configuration, configurations, scalars, rms_um with its standard error.
    """
    rows: list[dict[str, Any]] = []
    for robot, frame in frames.items():
        for (kind, scalars), cell in frame.groupby(["kind", "scalars"], sort=False):
            for configurations in sorted({length, 6 * length // int(str(scalars))}):
                squares = cell.mean_square[cell.length == configurations].to_numpy()
                if len(squares):
                    rms, error = root_mean(squares)
                    row: dict[str, Any] = {"robot": robot, "kind": kind, "scalars_per_configuration": scalars}
                    row |= {"configurations": configurations, "scalars": configurations * int(str(scalars))}
                    rows.append(row | {"rms_um": MICRO * rms, "rms_um_std_error": MICRO * error})
    return pd.DataFrame(rows)


def simulated_designs_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Simulated errors of random and chosen configurations by the kind of load.

    `frames`: the simulated_designs table of each robot. Returns robot, load, design, configurations, unobservable, rms_um with
    its standard error, at_test_pose_um, and gain: the error of random designs of the size over that of the design.
    """
    frame = _of_all_robots(frames)
    names = {"rms": "rms_um", "std_error": "rms_um_std_error", "there": "at_test_pose_um"}
    errors = MICRO * frame[[*names]].rename(columns=names)
    part = frame[["robot", "load", "design", "configurations", "unobservable"]].join(errors)
    size = ["robot", "load", "configurations"]
    random = part[part.design == RANDOM].set_index(size).rms_um
    return part.assign(gain=random.reindex(pd.MultiIndex.from_frame(part[size])).to_numpy() / part.rms_um)


def stiffness_table(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """What the Cartesian stiffness of the loaded arm (equation 6) changes.

    `frames`: the stiffness table of each robot. Returns robot, force_N, softest_N_per_um, first_order_percent, loaded_percent,
    by_k_c_percent, bias_percent, k_sigma_percent, offset_rank, rank.
    """
    frame = _of_all_robots(frames)
    part = pd.DataFrame({"robot": frame.robot, "force_N": frame.force, "softest_N_per_um": frame.softest / MICRO})
    part = part.join(frame[["first_order", "loaded", "by_k_c", "bias", "k_sigma"]].add_suffix("_percent"))
    return part.join(frame[["offset_rank", "rank"]])


def _of_all_robots(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The tables of all robots one below the other, with the name of the robot in front."""
    return pd.concat(frames, names=["robot"]).reset_index("robot").reset_index(drop=True)
