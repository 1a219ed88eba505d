"""How much of a residual can be predicted at all: what no named effect explains, but a flexible regression does."""

import numpy as np
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.model_selection import GroupKFold

_FOLDS = 5
_TREES = 60
_SMALLEST_LEAF = 3
# More poses than this teach the forest little and cost much.
_MOST_OBSERVATIONS = 4000


def explainable_share(fitted, observations):
    """Share of the residual's mean square that a forest predicts on poses it has not seen, from joint angles and load.

    It names nothing; it says whether something systematic is left to be found.

    Parameters
    ----------
    fitted : Fit
    observations : Observations
        Those fitted.

    Returns
    -------
    float
        0 .. 1; 0 where the forest does no better than nothing.
    """
    states = observations.states
    pose = np.column_stack([np.cos(states.joint_angles), np.sin(states.joint_angles), states.wrench])[observations.state]
    inputs = np.column_stack([pose, observations.target])
    every = max(1, -(-len(observations) // _MOST_OBSERVATIONS))
    kept = observations.cluster % every == 0
    inputs, cluster = inputs[kept], observations.cluster[kept]
    wanted = fitted.whitened(fitted.residual)[kept]
    predicted = np.zeros_like(wanted)
    for known, unseen in GroupKFold(min(_FOLDS, len(np.unique(cluster)))).split(inputs, groups=cluster):
        forest = ExtraTreesRegressor(_TREES, min_samples_leaf=_SMALLEST_LEAF, random_state=0)
        predicted[unseen] = forest.fit(inputs[known], wanted[known]).predict(inputs[unseen])
    total = (wanted**2).sum()
    return float(max(0.0, 1.0 - ((wanted - predicted) ** 2).sum() / total)) if total else 0.0
