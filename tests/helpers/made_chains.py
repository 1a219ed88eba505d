"""Chains with errors of their constants, as calibrations find them."""

from dataclasses import replace

import numpy as np

from elastocal.mechanics.chain import SIX_DISPLACEMENTS, insert_coordinates


def perturb_axes(chain, size, seed=1):
    """Displace each joint axis by errors of this standard deviation, m and rad."""
    stream = np.random.default_rng(seed)
    joints = [
        number
        for number, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
    ]
    longer = insert_coordinates(chain, dict.fromkeys(joints, SIX_DISPLACEMENTS))
    transforms = []
    for transform in longer.transforms:
        error = size * stream.standard_normal()
        if (transform.coordinate or 0) >= chain.coordinates:
            transform = replace(transform, constant=error, coordinate=None)
        transforms.append(transform)
    return replace(longer, transforms=tuple(transforms), coordinates=chain.coordinates)
