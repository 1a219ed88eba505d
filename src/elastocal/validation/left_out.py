"""Errors of configurations that a fit was not given, without fitting again: leave-one-out cross-validation in closed form.

In a generalized ridge regression the residual of rows that are left out is (I - H)^-1 times that of the fit, where H is their
block of the hat matrix [1]. Priors and noise stay those of the fit.

[1] Cook, R. D. and Weisberg, S., Residuals and Influence in Regression, section 2.2, Chapman and Hall, 1982.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.joint_space import configurations
from elastocal.fitting.observations import state_clusters

if TYPE_CHECKING:
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.observations import Observations

# What a pose alone determines, such as the frame of a session of one pose, is no error of it: shares below are rounding.
_ROUNDING = 1e-9


def left_out_squares(fitted: Fit, observations: Observations) -> np.ndarray:
    """Mean square position error of each configuration as all others predict it, m², ndarray (configurations,)."""
    white = fitted.whitened(fitted.residual)
    states = observations.states
    configuration = configurations(states.joint_angles, state_clusters(states))[observations.cluster]
    found = np.empty(configuration.max() + 1)
    plain, whitened = (np.concatenate(parts) for parts in list(zip(*fitted.sensitivities(observations), strict=True))[1:])
    for number in range(len(found)):
        mine = configuration == number
        rows = whitened[mine].reshape(mine.sum() * whitened.shape[1], len(fitted.held))
        gain = fitted.covariance @ rows.T
        inverse = np.linalg.pinv(np.eye(len(rows)) - rows @ gain, rcond=_ROUNDING, hermitian=True)
        moved = plain[mine][:, :3] @ (gain @ (inverse @ white[mine].ravel()))
        found[number] = ((fitted.residual[mine][:, :3] + moved) ** 2).sum(axis=1).mean()
    return found


def certain_loss(squares: np.ndarray, others: np.ndarray) -> bool:
    """Whether mean squares exceed those of another model on the same poses by more than the difference's standard error."""
    off = squares - others
    return bool(off.mean() > off.std(ddof=1) / np.sqrt(len(off)))
