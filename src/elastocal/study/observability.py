"""Observability indices: which number tells the worth of configurations beforehand (RQ3).

They are numbers of the singular values s_1 >= ... >= s_m of the identification Jacobian of k configurations [1]:
O1 = (s_1 ... s_m)^(1/m) / sqrt(k), O2 = s_m / s_1, O3 = s_m, O4 = s_m^2 / s_1, O5 = 1 / sum 1/s_i.

[1] Sun, Y. and Hollerbach, J. M., Observability index selection for robot calibration, IEEE International Conference on
    Robotics and Automation, 2008.
"""

import numpy as np

INDICES = ("O1", "O2", "O3", "O4", "O5")


def observability(information: np.ndarray, configurations: int) -> dict[str, np.ndarray]:
    """Observability indices of identification Jacobians.

    `information` (..., m, m): their products J'J, in whatever units the parameters have. Returns (...).
    """
    values = np.sqrt(np.clip(np.linalg.eigvalsh(information), np.finfo(float).tiny, None))
    smallest, largest = values[..., 0], values[..., -1]
    every = (
        np.exp(np.log(values).mean(axis=-1)) / np.sqrt(configurations),
        smallest / largest,
        smallest,
        smallest**2 / largest,
        1.0 / (1.0 / values).sum(axis=-1),
    )
    return dict(zip(INDICES, every, strict=True))
