"""Is a residual more than noise?"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from elastocal.whitening import whitening

# A declared noise is trusted to about ten percent: so many degrees of freedom it stands for.
_DECLARED_FREEDOM = 50
LEVEL = 0.005


@dataclass(frozen=True)
class LackOfFit:
    """A residual against the noise alone.

    Attributes
    ----------
    ratio : float
        Mean square of the residual over that of the noise; not a number where the noise is not known.
    p_value : float
    residual_freedom, noise_freedom : int
    """

    ratio: float
    p_value: float
    residual_freedom: int
    noise_freedom: int

    @property
    def rejected(self):
        """Whether the residual is more than noise."""
        return bool(self.p_value < LEVEL)

    @property
    def excess(self):
        """Mean square above the noise, in units of it; at least zero."""
        return max(self.ratio - 1.0, 0.0)


def lack_of_fit(fitted, observations):
    """F test of the residual of a fit against the noise, without any discrepancy of the model.

    Parameters
    ----------
    fitted : Fit
    observations : Observations

    Returns
    -------
    LackOfFit
    """
    freedom = fitted.tame_freedom
    if fitted.noise.source == "residual" or freedom <= 0:
        return LackOfFit(np.nan, np.nan, freedom, 0)
    whitener = whitening(observations, fitted.joint_jacobian, fitted.noise)
    whitened = whitener.apply(fitted.residual * np.sqrt(fitted.weights * fitted.tame)[:, None])
    ratio = (whitened**2).sum() / freedom
    noise_freedom = fitted.noise.degrees_of_freedom or _DECLARED_FREEDOM
    return LackOfFit(float(ratio), float(f_distribution.sf(ratio, freedom, noise_freedom)), freedom, noise_freedom)
