"""Random numbers of the study, drawn again from how docs/audit.md says that they are named.

A stream is a Philox counter generator. Its key is the first 16 bytes of the SHA-256 of ``seed/robot``, the third word of its
counter the data set, the fourth the first 8 bytes of the SHA-256 of what the numbers are for.
"""

from __future__ import annotations

import hashlib

import numpy as np


def numbers(seed: int, robot: str, purpose: str, data_set: int) -> np.random.Generator:
    """The stream of one purpose in one data set.

    `robot`: name of the robot's file.
    """
    key = hashlib.sha256(f"{seed}/{robot}".encode()).digest()
    words = [int.from_bytes(key[start : start + 8], "little") for start in (0, 8)]
    use = int.from_bytes(hashlib.sha256(purpose.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.Philox(key=np.array(words, np.uint64), counter=[0, 0, data_set, use]))
