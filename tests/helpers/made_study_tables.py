"""Tables of the study made up for its report: two robots, two strategies, round figures."""

from itertools import product

import numpy as np
import pandas as pd

from elastocal.report.study import study_facts
from elastocal.study.strategies import Stage, Strategy
from elastocal.study.uses import METRICS

TITLES = {"kuka": "Kuka", "fanuc": "Fanuc"}
STATED = {"force_N": 1000, "offset_m": 0.5, "edge_m": 1.0, "weight_N": 1000, "path_m": 0.5, "cutting_N": 500}
STRATEGIES = ("6DoF", "2DoF+6DoF")


def rows_of(**columns):
    """A row for every combination of what is listed, the first varying slowest."""
    return pd.DataFrame(product(*columns.values()), columns=[*columns])


def for_each_robot(frame):
    return pd.concat([frame.assign(robot=robot) for robot in TITLES], ignore_index=True)


def comparison():
    """Of four figures of Tables 3 and 4 one differs after Holm's correction and two are below 0.05 before."""
    names = ["table", "robot", "strategy", "quantity", "paper", "ours", "mc_std", "z", "interpretation"]
    names += ["studies_mean", "studies_std", "p_value", "p_holm"]
    rows = [
        ("1", "kuka", np.nan, "c1", 0.54, 0.54, 0.0, np.nan, "R1: an input", np.nan, np.nan, np.nan, np.nan),
        ("2", "kuka", np.nan, "deviation_mean", 1.1, 1.0, 0.02, -5.0, "R3", 1.05, 0.05, 0.31, np.nan),
        ("2", "other", np.nan, "deviation_max", 3.0, np.nan, np.nan, np.nan, "R3", np.nan, np.nan, np.nan, np.nan),
        ("3", "kuka", "6DoF", "c1", 0.54, 0.53, 0.01, -1.0, "R7", 0.531, 0.012, 0.5, 1.0),
        ("4", "kuka", "6DoF", "k_sigma_20", 1.5, 1.8, 0.1, 3.0, "R7", 1.75, 0.1, 0.0004, 0.002),
        ("4", "kuka", "6DoF", "dev_20", 1.0, 1.25, 0.1, 2.5, "R8", 1.2, 0.08, 0.04, 0.16),
        ("4", "fanuc", "6DoF", "n_dev_2_um", 30.0, np.inf, np.nan, np.nan, "R8", 110.0, 40.0, 0.06, 0.18),
        ("text", "kuka", np.nan, "deviation_ratio", 4.0, 3.9, 0.1, -1.0, "R8", np.nan, np.nan, np.nan, np.nan),
        ("text", "kuka", np.nan, "share_with_links", 92.0, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan),
    ]
    return pd.DataFrame(rows, columns=names)


def ladder():
    rows = [("0", 40.0, 0.5, 25.0), ("1", 20.0, 0.4, 75.0), ("by cross-validation", 22.0, 0.5, np.nan)]
    frame = pd.DataFrame(rows, columns=["link_springs", "rms_um", "rms_um_std_error", "chosen_percent"])
    return frame.assign(robot="bending", noise_um=200.0, length=20)


def budget():
    rows = [("6DoF", 1, 20, 79.0), ("6DoF", 1, 40, 52.0), ("3+6DoF", 2, 20, 57.0)]
    names = ["points", "measurements_per_configuration", "configurations", "rms_um"]
    return for_each_robot(pd.DataFrame(rows, columns=names).assign(std_error_um=0.5, crlb_rms_um=50.0))


def pairs():
    rows = [(robot, "3+6DoF", ratio, ratio - 0.05, ratio + 0.05) for robot, ratio in (("kuka", 1.1), ("fanuc", 1.03))]
    return pd.DataFrame(rows, columns=["robot", "points", "ratio", "ratio_low", "ratio_high"])


def needed():
    names = ["robot", "points", "accuracy_um", "configurations", "configurations_low", "configurations_high"]
    rows = [("kuka", "6DoF", 60.0, 32.0, 30.0, 34.0), ("fanuc", "6DoF", 60.0, np.inf, 90.0, np.inf)]
    frame = pd.DataFrame([*rows, ("kuka", "6DoF", 40.0, 9, 9, 9)], columns=names)
    return frame.assign(configurations_by_bound=frame.configurations, measurements=frame.configurations)


def designs():
    values = {"random": (200.0, 80.0), "D": (90.0, 45.0), "A": (95.0, 50.0), "I": (88.0, 40.0), "bound": (80.0, 36.0)}
    frame = rows_of(joint_range=["full_turn", "limits"], robot=TITLES, design=values, configurations=[4, 20])
    rms = [values[design][size == 20] for design, size in zip(frame.design, frame.configurations, strict=True)]
    return frame.assign(rms_um=rms, low_um=rms, high_um=rms)


def strategy_scores():
    """A staged strategy that is worse by every metric but the sum over the joints that its last stage fixes."""
    frame = rows_of(robot=TITLES, metric=METRICS, strategy=["6DoF", "staged"])
    better, staged = frame.metric.str.endswith("fixed_joints"), frame.strategy == "staged"
    ratio = np.where(staged, np.where(better, 0.5, 1.2), 1.0)
    frame = frame.assign(value=75.0 * ratio, value_std_error=0.5, ratio=ratio)
    half = np.where(staged, 0.05, 0.0)
    return frame.assign(ratio_low=ratio - half, ratio_high=ratio + half, rank=np.where(staged == better, 1, 2))


def score_pairs():
    frame = rows_of(robot=TITLES, metric=METRICS, strategy=["6DoF"], other=["staged"])
    turned = frame.metric.str.endswith("fixed_joints") & (frame.robot == "kuka")
    for name, usual, other in (("ratio", 0.83, 2.0), ("ratio_low", 0.80, 1.5), ("ratio_high", 0.86, 2.5)):
        frame[name], frame[f"rms_{name}"] = np.where(turned, other, usual), usual
    return frame.assign(reversed=turned)


def measured():
    """Table 4 over studies: the second strategy has a quarter of dev; averages of compliances round figures."""
    frame = rows_of(robot=TITLES, average=["stiffness", "compliance"], strategy=STRATEGIES)
    part, share = np.where(frame.average == "stiffness", 1.0, 0.25), np.where(frame.strategy == STRATEGIES[0], 1.0, 0.25)
    for name, size in (("k_sigma", 4.0), ("k_sigma_fixed_joints", 2.0)):
        frame[f"{name}_20_percent"], frame[f"{name}_20_percent_std"] = size * part, 0.4
        frame[f"n_{name}_1_percent"], frame[f"n_{name}_1_percent_std"] = 80.0, 20.0
    frame = frame.assign(dev_20_um=8.0 * part * share, dev_20_um_std=0.8, n_dev_2_um=90.0, n_dev_2_um_std=9.0)
    return frame.assign(rms_20_um=80.0, rms_20_um_std=1.0)


def joint():
    row = {"joints": "fixed joints", "cells": 60, "differ": 2, "studies": 16, "below": 9, "below_studies_median": 3.0}
    row |= {"below_studies_largest": 7.0, "below_p": 1 / 17, "statistic": 171.0, "statistic_studies_median": 120.0}
    row |= {"statistic_studies_largest": 218.0, "statistic_p": 2 / 17}
    return pd.DataFrame([row, row | {"joints": "all joints", "differ": 10}])


def break_even():
    row = {"accuracy_um": 60.0, "points": "3+6DoF", "against": "6DoF", "configurations": 18.2, "configurations_against": 31.7}
    return for_each_robot(pd.DataFrame([row | {"break_even": 0.35, "break_even_low": 0.2, "break_even_high": np.inf}]))


def costs():
    rows = [("6DoF", 0.1, True), ("3+6DoF", 0.1, False), ("6DoF", 1.0, False), ("3+6DoF", 1.0, True)]
    frame = pd.DataFrame(rows, columns=["points", "configuration_cost", "cheapest"])
    return for_each_robot(frame.assign(cost=[50.0, 60.0, 80.0, 70.0], ratio=1.0, ratio_low=0.9, ratio_high=1.1))


def simulated():
    rms = {"random": 140.0, "D": 66.0, "A": 65.0, "I": 59.0, "test pose": 140.0}
    frame = rows_of(robot=TITLES, load=["random", "hanging"], configurations=[6, 20], design=rms)
    there = frame.design.map(rms)
    frame = frame.assign(unobservable=frame.load.map({"random": np.nan, "hanging": "1"}), at_test_pose_um=there)
    return frame.assign(rms_um=there * 6 / frame.configurations + 20, rms_um_std_error=0.8, gain=140 / there)


def tables():
    """All tables of the report."""
    everything = {f"{name}_mm{end}": 1.0 for name in ("mean", "std", "max") for end in ("", "_one_set")}
    extended = {"strategy": "6DoF", "robot": "bending", "initial_mean_mm": 1.234, "initial_mean_mm_std_error": 0.011}
    extended |= {"residual_mean_um": 366.0, "residual_mean_um_std_error": np.nan}
    extended |= {"share_compensated_percent": 70.0, "share_compensated_percent_std_error": 0.5}
    table2 = {"robot": "kuka", "mean_mm_one_set_std": 0.05} | everything | {"mean_mm_one_set": 1.05}
    return {
        **{"joint": joint(), "studies": measured(), "break_even": break_even(), "simulated": simulated(), "ladder": ladder()},
        **{"budget": budget(), "pairs": pairs(), "needed": needed(), "scores": strategy_scores(), "score_pairs": score_pairs()},
        **{"comparison": comparison(), "table2": pd.DataFrame([table2]), "extended": pd.DataFrame([extended])},
    }


def facts(**changed):
    """Facts of the report of these tables, some of which may be changed."""
    names = TITLES | {"bending": "Kuka with elastic links"}
    settings = {"noise_um": 200.0, "length": 20, "configurations": 100, "classical": STRATEGIES[0], "best": STRATEGIES[1]}
    settings |= {"accuracy_um": 60.0, "stated": STATED, "strategies": [Strategy("6DoF", (Stage(("6DoF",), tuple(range(6))),))]}
    return study_facts(tables() | changed, names, [*TITLES], settings) | {
        "citation": {"authors": "the developers", "date": "2026-11-25", "version": "0.1.0", "license": "MIT"},
        "names": names,
        "full_names": [*TITLES.values()],
        "size": {"data_sets": "1000", "configurations": "100", "test_configurations": "500", "seed": "1"},
    }
