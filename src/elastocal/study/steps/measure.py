"""Step 2: noise on the ideal deflections."""

from collections.abc import Iterable, Iterator

import numpy as np

from elastocal.mechanics.components import COMPONENT_NAMES
from elastocal.study.simulation import measurement_noise
from elastocal.study.steps.columns import block_shape, data_sets


def measured_blocks(
    ideal_blocks: Iterable[dict[str, np.ndarray]], key: str, seed: int, noise: float
) -> Iterator[dict[str, np.ndarray | str]]:
    """Deflections as measured: ideal plus independent normal noise on every component.

    `ideal_blocks`: blocks of the deflections table. `key`: name of the robot's file. `noise`: standard deviation, the same
    number in m and rad. Yields columns of one block of the deflections table.
    """
    for block in ideal_blocks:
        _, configurations = block_shape(block)
        point = block["point"][0]
        normal = measurement_noise(seed, key, point, data_sets(block), configurations)
        measured = {name: block[name] + noise * normal[..., k].ravel() for k, name in enumerate(COMPONENT_NAMES)}
        yield block | measured | {"point": point}
