"""What errors of the load have in common: a changed wrench, which the joint compliances turn into angles."""

from dataclasses import dataclass

import numpy as np

from elastocal.effects.protocol import Candidate


@dataclass(frozen=True)
class Axis:
    """A direction, which may differ from state to state: ndarray (S, 3)."""

    direction: np.ndarray

    def turn(self, wrench):
        """Change of a wrench (S, 6) when its force is turned by one radian about the axis."""
        return _wrench(np.cross(self.direction, wrench[:, :3]), 0.0)

    def push(self, wrench):
        """A force of 1 N along the axis wherever there is a load."""
        return _wrench(self.direction * wrench.any(axis=1)[:, None], 0.0)

    def shift(self, wrench):
        """Change of a wrench when its force acts one metre further along the axis."""
        return _wrench(0.0, np.cross(self.direction, wrench[:, :3]))


def base_and_flange(name, family, parameters, change):
    """Candidates for an error of the load that is fixed in base axes or turns with the flange.

    Parameters
    ----------
    name, family : str
    parameters : tuple of Parameter
        For x, y and z.
    change : callable
        ``change(axis, wrench)`` is the change (S, 6) of a wrench (S, 6) per unit of the parameter of an `Axis`.

    Returns
    -------
    list of Candidate
    """

    def in_base(circumstances):
        axes = [np.broadcast_to(axis, circumstances.wrench[:, :3].shape) for axis in np.eye(3)]
        return _deflections(circumstances, axes)

    def in_flange(circumstances):
        return _deflections(circumstances, np.moveaxis(circumstances.end_rotation, -1, 0))

    def _deflections(circumstances, axes):
        turned = [circumstances.joint_deflections(change(Axis(axis), circumstances.wrench)) for axis in axes]
        return [dict(enumerate(angles.T)) for angles in turned]

    return [
        Candidate(name, family, (), frame, parameters, law, frozenset({"load"}))
        for frame, law in (("base axes", in_base), ("flange axes", in_flange))
    ]


def _wrench(force, moment):
    shape = np.shape(force) or np.shape(moment)
    return np.concatenate([np.broadcast_to(force, shape), np.broadcast_to(moment, shape)], axis=1)
