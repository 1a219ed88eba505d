"""Which poses share a configuration, in plain numpy."""

import numpy as np

# Joint angles of poses of one configuration, rad, as docs/campaign.md states it.
_SAME_RAD = 0.02


def configurations(joint_angles: np.ndarray) -> np.ndarray:
    """The configuration of each pose (P, n), rad: the first without one takes all that are near it; ndarray of int (P,)."""
    found = np.full(len(joint_angles), -1)
    while (found < 0).any():
        first = joint_angles[np.argmax(found < 0)]
        found[(found < 0) & (np.abs(joint_angles - first).max(axis=1) <= _SAME_RAD)] = found.max() + 1
    return found
