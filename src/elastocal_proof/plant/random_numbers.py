"""Random numbers of the plant, none of which the analysis can draw."""

import hashlib

import numpy as np


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Random numbers for one purpose: numpy Generator that depends on the two alone."""
    digest = hashlib.sha256(f"plant/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))
