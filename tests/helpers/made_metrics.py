"""Metrics of the study whose k_sigma and deviation fall as one over the length, and replicates of them."""

import numpy as np
import pandas as pd

LENGTHS = np.arange(1, 101)


def metrics_of(strategy, bias=100.0, robot="arm"):
    """Metrics whose k_sigma and deviation fall as bias / length: percent and µm."""
    frame = pd.DataFrame({"robot": robot, "noise_um": 200.0, "strategy": strategy, "length": LENGTHS})
    for name, scale in (("k_sigma", 1.0), ("k_sigma_fixed_joints", 0.5), ("deviation", 1e-6)):
        frame[name], frame[f"{name}_std_error"] = scale * bias / LENGTHS, scale
    frame["initial_deviation"], frame["initial_deviation_std_error"] = 1e-3, 1e-5
    return frame


def replicates_of(strategy, bias=100.0, robot="arm", spread=(-0.1, 0.0, 0.1)):
    parts = []
    for number, relative in enumerate(spread, 1):
        frame = metrics_of(strategy, bias * (1 + relative), robot)
        parts.append(frame.assign(replicate=number))
    return pd.concat(parts, ignore_index=True)
