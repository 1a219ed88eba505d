"""Tables of the study made up for its report: two robots, two strategies, round figures."""

import numpy as np
import pandas as pd

from elastocal.report.answers import answers

TITLES = {"kuka": "Kuka", "fanuc": "Fanuc"}
CELLS = {"noise_um": 200.0, "length": 20, "classical_strategy": "6DoF"}
STRATEGIES = ("6DoF", "2DoF+6DoF")


def metrics(noise_um=200.0, nonpositive=0.0, spread=0.1):
    """At 10 and 20 configurations: dev of 6DoF 4 and 2 µm, of the other a quarter; 1 mm before calibration."""
    rows = []
    for robot in TITLES:
        for strategy, part in zip(STRATEGIES, (1.0, 0.25), strict=True):
            for length in (10, 20):
                row = {"robot": robot, "noise_um": noise_um, "strategy": strategy, "length": length}
                row |= {"deviation": part * 40e-6 / length, "deviation_std_error": part * 0.1e-6}
                row |= {"initial_deviation": 1e-3, "nonpositive_share": nonpositive, "relative_spread": spread}
                rows.append(row)
    return pd.DataFrame(rows)


def per_dataset():
    """RMS errors of 6DoF 120 and 60 µm, of the other 80 and 40 µm; at another noise level other figures."""
    rows = []
    for noise_um in (200.0, 500.0):
        for robot in TITLES:
            for strategy, size in zip(STRATEGIES, (1200.0, 800.0), strict=True):
                for ds in (10, 20):
                    rms = size / ds * noise_um / 200.0
                    row = {"robot": robot, "noise_um": noise_um, "strategy": strategy, "ds": ds, "rms_um": rms}
                    row |= {"mean_um": 0.9 * rms, "mean_um_std_error": 0.5, "p95_um": 1.5 * rms, "p95_um_std_error": 1.2}
                    rows.append(row | {"efficiency": 640.0 / size - 0.3, "efficiency_std_error": 0.012})
    return pd.DataFrame(rows)


def comparison():
    names = ["table", "robot", "strategy", "quantity", "paper", "ours", "mc_std", "z", "interpretation"]
    rows = [
        ("1", "kuka", np.nan, "c1", 0.54, 0.54, 0.0, np.nan, "R1: an input"),
        ("2", "kuka", np.nan, "deviation_mean", 1.1, 1.0, 0.02, -5.0, "R3"),
        ("2", "fanuc", np.nan, "deviation_max", 3.0, 3.1, 0.1, 1.0, "R3"),
        ("2", "other", np.nan, "deviation_max", 3.0, np.nan, np.nan, np.nan, "R3"),
        ("3", "kuka", "6DoF", "c1", 0.54, 0.53, 0.01, -1.0, "R7"),
        ("4", "kuka", "6DoF", "k_sigma_20", 1.5, 1.8, 0.1, 3.0, "R7"),
        ("4", "kuka", "6DoF", "dev_20", 1.0, 1.25, 0.1, 2.5, "R8"),
        ("4", "fanuc", "6DoF", "n_dev_2_um", 30.0, np.inf, np.nan, np.nan, "R8"),
        ("text", "kuka", np.nan, "deviation_ratio", 4.0, 3.9, 0.1, -1.0, "R8"),
        ("text", "kuka", np.nan, "share_with_links", 92.0, np.nan, np.nan, np.nan, np.nan),
    ]
    return pd.DataFrame(rows, columns=names)


def facts(**changed):
    """Facts of the report of these tables, some of which may be changed."""
    everything = {f"{name}_mm{end}": 1.0 for name in ("mean", "std", "max") for end in ("", "_one_set")}
    replicates = pd.concat([metrics().assign(replicate=n) for n in (1, 2)])
    grows = (replicates.replicate == 2) & (replicates.strategy == "6DoF")
    extended = {"strategy": "6DoF", "robot": "kuka_extended", "initial_mean_mm": 1.234, "initial_mean_mm_std_error": 0.011}
    extended |= {"residual_mean_um": 366.0, "residual_mean_um_std_error": np.nan}
    extended |= {"share_compensated_percent": 70.0, "share_compensated_percent_std_error": 0.5}
    solvers = {"robot": "kuka", "strategy": "6DoF", "closest_strategy": "2DoF+6DoF"}
    solvers |= {"equation_11_difference": 2.4e-3, "gauss_newton_difference": 0.0, "between_solvers": 1.6e-4}
    given = {
        "comparison": comparison(),
        "table2": pd.DataFrame([{"robot": "kuka", "mean_mm_one_set_std": 0.05} | everything | {"mean_mm_one_set": 1.05}]),
        "per_dataset": per_dataset(),
        "extended": pd.DataFrame([extended]),
        "solvers": pd.DataFrame([solvers]),
        "metrics": metrics(),
        "replicates": replicates.assign(deviation=replicates.deviation * np.where(grows, 1.1, 1.0)),
        "noisiest": metrics(500.0, 0.012, 0.4),
        "titles": TITLES,
        "cells": CELLS,
    }
    return answers(**given | changed)
