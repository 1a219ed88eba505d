"""Geometry and elasticity together: what is identified at once, one after the other, or alone, and what leaks into what.

Unloaded poses y_u = G g + e and loaded ones y_l = G g + A c + e, with g errors of joint zeros and link lengths, c compliances
and e independent noise, are linear in both. Every estimator here is linear, too, so that its noise and its leak, which is what
it makes of the parameters that it leaves out, follow in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import with_inserted
from elastocal.mechanics.kinematics import jacobians

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain

AT_ONCE, IN_TURN, DIFFERENCES = "at once", "geometry from unloaded poses, then compliances", "compliances from differences"
NO_GEOMETRY, NO_ELASTICITY = "compliances from loaded poses alone", "geometry from all poses alone"


# A leak below this share of a parameter's size is rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Quality:
    """How well an estimator does, mean over data sets.

    `noise`, `leak`: RMS of the predicted loaded position, m: by noise, and by what the estimator leaves out or takes for
    something else. `compliance_noise`, `compliance_leak` (n,): standard deviation and root mean square leak of the compliances,
    of their true values. `zero_noise`, `zero_leak` (n,): of the joint zeros, rad.
    """

    noise: float
    leak: float
    compliance_noise: np.ndarray
    compliance_leak: np.ndarray
    zero_noise: np.ndarray
    zero_leak: np.ndarray


def geometry_columns(chain: Chain, joint_angles: np.ndarray) -> np.ndarray:
    """Sensitivities of the end-effector's pose to joint zeros and to the lengths of the chain.

    `joint_angles` (..., n). Returns (..., 6, n + L): per rad, and per m for each fixed translation that is not zero.
    """
    lengths = {
        number + 1: [("T", transform.axis)]
        for number, transform in enumerate(chain.transforms)
        if transform.kind == "T" and transform.coordinate is None and transform.constant
    }
    longer = with_inserted(chain, lengths)
    coordinates = np.zeros((*joint_angles.shape[:-1], longer.coordinates))
    coordinates[..., : chain.coordinates] = joint_angles
    return jacobians(longer, coordinates, longer.end_effector)


def qualities(
    geometry: np.ndarray,
    elasticity: np.ndarray,
    noise: float,
    compliance: np.ndarray,
    geometry_std: np.ndarray,
    moment: np.ndarray,
) -> dict[str, Quality]:
    """Noise and leak of every estimator.

    `geometry` (sets, rows, G): columns of the joint zeros first. `elasticity` (sets, rows, n): of the loaded poses in the same
    configurations. `noise`: standard deviation of every row. `compliance` (n,): True ones. `geometry_std` (G,): of the errors
    of geometry, of mean zero. `moment` (G + n, G + n): mean product of the sensitivities of the loaded position where the robot
    shall be accurate.
    """
    size, n = geometry.shape[2], elasticity.shape[2]
    both = np.concatenate(
        [
            np.concatenate([geometry, np.zeros_like(elasticity)], axis=2),
            np.concatenate([geometry, elasticity], axis=2),
        ],
        axis=1,
    )
    truth = np.concatenate([geometry_std, compliance])
    found = {}
    for name, estimator in _estimators(geometry, elasticity, both).items():
        spread = noise**2 * estimator @ estimator.swapaxes(1, 2)
        # What becomes of the true parameters, less these: random where geometry is, the same each time where it is compliances.
        wrong = (estimator @ both - np.eye(size + n)) * truth
        wrong[np.abs(wrong) < _ROUNDING * truth[:, None]] = 0.0
        random, fixed = wrong[..., :size], wrong[..., size:].sum(axis=2)
        missed = random @ random.swapaxes(1, 2) + fixed[:, :, None] * fixed[:, None, :]
        by_noise, by_leak = (np.sqrt(np.diagonal(each, axis1=1, axis2=2).mean(axis=0)) for each in (spread, missed))
        found[name] = Quality(
            float(np.sqrt((moment * spread.mean(axis=0)).sum())),
            float(np.sqrt((moment * missed.mean(axis=0)).sum())),
            by_noise[size:] / compliance,
            by_leak[size:] / compliance,
            by_noise[:n],
            by_leak[:n],
        )
    return found


def _estimators(geometry: np.ndarray, elasticity: np.ndarray, both: np.ndarray) -> dict[str, np.ndarray]:
    """Linear maps (sets, G + n, 2 rows) from unloaded and loaded poses to the parameters."""
    unloaded, loaded = _pseudo_inverse(geometry), _pseudo_inverse(elasticity)
    nothing = np.zeros_like(unloaded)
    of_geometry = np.concatenate([unloaded, nothing], axis=2)
    explained = -loaded @ geometry @ unloaded
    halves = np.concatenate([unloaded, unloaded], axis=2) / 2
    return {
        AT_ONCE: _pseudo_inverse(both),
        IN_TURN: np.concatenate([of_geometry, np.concatenate([explained, loaded], axis=2)], axis=1),
        DIFFERENCES: np.concatenate([of_geometry, np.concatenate([-loaded, loaded], axis=2)], axis=1),
        NO_GEOMETRY: np.concatenate(
            [np.zeros_like(of_geometry), np.concatenate([np.zeros_like(loaded), loaded], axis=2)], axis=1
        ),
        NO_ELASTICITY: np.concatenate([halves, np.zeros((*halves.shape[:1], elasticity.shape[2], halves.shape[2]))], axis=1),
    }


def _pseudo_inverse(matrices: np.ndarray) -> np.ndarray:
    """(X'X)^-1 X' by QR, of columns in the size of their norms."""
    scale = np.linalg.norm(matrices, axis=1, keepdims=True)
    basis, triangle = np.linalg.qr(matrices / scale)
    return np.linalg.solve(triangle, basis.swapaxes(1, 2)) / scale.swapaxes(1, 2)
