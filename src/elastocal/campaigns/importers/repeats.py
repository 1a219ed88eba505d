"""Which rows of a source are repeats of one pose, where the source does not say."""

import numpy as np
import scipy  # Its parts load as they are used: the rules ask importers for their files alone, at each start of Snakemake.


def pose_and_repeat(joint_angles: np.ndarray, tolerance_rad: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Number poses by their joint angles.

    Single-linkage clusters [1] by the largest difference of angles, cut at the tolerance.

    `joint_angles` (N, n): rad. `tolerance_rad`: rows whose angles all lie this close are one pose, and so is a chain of such
    rows. Returns `pose`, `repeat` (N,): poses from 0 in the order in which they first come, repeats of each from 0.

    [1] Gower, J. C. and Ross, G. J. S., Minimum spanning trees and single linkage cluster analysis, Applied Statistics 18,
        1969.
    """
    # At each start of Snakemake the rules ask importers for their files alone.
    import pandas as pd

    count = len(joint_angles)
    pairs = scipy.spatial.KDTree(joint_angles).query_pairs(tolerance_rad, p=np.inf, output_type="ndarray")
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    label = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
    pose = pd.Series(pd.factorize(label)[0], dtype=np.int32)
    return pose.to_numpy(), pose.groupby(pose).cumcount().to_numpy(np.int32)
