"""Synthetic tables of corrected targets, and of what was measured there."""

import numpy as np
import pandas as pd

ANGLES = [f"q{joint}" for joint in range(1, 7)]
WRENCH = ["fx", "fy", "fz", "mx", "my", "mz"]
POSE = ["x", "y", "z", "rx", "ry", "rz"]


def write_targets(path, count=10, **changes):
    """Write a table as `elastocal correct` does; the second half of its targets is
    loaded."""
    stream = np.random.default_rng(4)
    table = pd.DataFrame(stream.uniform(-0.5, 0.5, (count, 6)), columns=ANGLES)
    table["predicted_error_before_m"] = 2e-3
    table["predicted_error_after_m"] = 1e-4
    table["predicted_bound_m"] = 2e-4
    table["status"] = "ok"
    table[POSE] = stream.uniform(-1.0, 1.0, (count, 6))
    table[WRENCH] = 0.0
    table.loc[count // 2 :, "fz"] = -200.0
    table.assign(**changes).to_csv(path, index=False)
    return pd.read_csv(path)


def write_measured(path, targets, separator=",", **columns):
    """Write positions at these targets, 1 mm above the wanted ones."""
    table = targets[["x", "y", "z"]] + [0.0, 0.0, 1e-3]
    table.assign(**columns).to_csv(path, index=False, sep=separator)
    return path
