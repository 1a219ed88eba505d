"""Small data sets and results of a benchmark."""

import numpy as np
import pandas as pd
from made_remainders import smoothly_wrong_folder

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.loop.loading import read_described_campaign
from elastocal_proof.league.methods import DataSet, deal_folds


def make_data_set(folder, robot, robots_folder, poses=24, **changes):
    """Make a data set of an unloaded robot whose errors are smooth."""
    changes = {
        "frame": "tracker",
        "offset_m": "unknown",
        "declared": ["joint_offset"],
    } | changes
    smoothly_wrong_folder(folder, robot, poses=poses, **changes)
    descriptions, campaign = read_described_campaign(
        read_campaign_folder(folder, robots_folder)
    )
    measurements = campaign.measurements
    return DataSet(
        descriptions,
        tabulate_measurements(measurements),
        deal_folds(measurements, 4, np.random.default_rng(1)),
    )


def make_entries(size_m, poses=40, seed=1, std_m=None, folds=4):
    """Draw rows of the entries table with errors of some size; each pose is measured
    with two targets."""
    rng = np.random.default_rng(seed)
    pose = np.repeat(np.arange(poses), 2)
    error = rng.normal(0.0, size_m, (2 * poses, 3))
    columns = {
        "fold": pose % folds + 1,
        "set": np.zeros(2 * poses, int),
        "session": np.zeros(2 * poses, int),
        "pose": pose,
    }
    columns |= {"load": np.zeros(2 * poses, int), "target": np.tile([0, 1], poses)}
    columns |= {f"d{axis}": error[:, number] for number, axis in enumerate("xyz")}
    return pd.DataFrame(
        columns
        | {
            f"std_{axis}": np.full(2 * poses, np.nan if std_m is None else std_m)
            for axis in "xyz"
        }
    )


def make_results(data=("one", "two"), splits=("random", "blocks", "session")):
    """Make the entries of three methods by data set, split and method: the geometry,
    one with half its error, and one that states intervals."""
    results = {}
    for number, name in enumerate(data):
        for split in splits:
            for method, size, std in (
                ("geometry", 2e-4, None),
                ("half", 1e-4, None),
                ("process", 1.2e-4, 1.2e-4),
            ):
                results[name, split, method] = make_entries(
                    size, 30 + 10 * number, number + 1, std
                )
    return results
