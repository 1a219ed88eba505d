"""Two arms on one base as one chain, from the flange of one arm to that of the other.

If the arms touch each other, a point of one flange is measured in the frame of the other
flange. In this frame the robot is a serial chain as any other one: the first arm from its
flange down to the base, then the second arm. Every kind of measurement works on it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from elastocal.errors import InputError
from elastocal.mechanics.chain import Chain, Transform
from elastocal.mechanics.robot import Robot


def join_arms(carrier: Robot, arm: Robot) -> Robot:
    """Join two arms with one base frame to a chain whose base is the carrier's flange.

    The controllers report the joint angles of the carrier, then those of the arm, each
    from the base on. Measuring points are those of the arm. Weights are left out, because
    the direction of gravity changes in the frame of the flange.

    Parameters
    ----------
    carrier : arm whose end-effector becomes the base.
    arm : arm whose end-effector remains the end-effector.

    Raises
    ------
    InputError
        A joint of the carrier slides, because reported angles and metres would change
        their order.
    """
    if any(carrier.chain.prismatic):
        allowed = "revolute joints; state the arm that slides second"
        raise InputError(carrier.name, "chain", "a joint that slides", allowed)
    inverse = _invert(carrier.chain)
    shift = carrier.joints
    transforms = [*inverse]
    for transform in arm.chain.transforms:
        coordinate = transform.coordinate
        moved = None if coordinate is None else coordinate + shift
        transforms.append(replace(transform, coordinate=moved))
    points = tuple(
        replace(point, after=point.after + len(inverse)) for point in arm.chain.points
    )
    offsets = [carrier.reported_offset[::-1], arm.reported_offset]
    limits = [carrier.joint_limits[::-1], arm.joint_limits]
    compliances = [carrier.compliance[::-1], arm.compliance]
    return Robot(
        name=f"{arm.name}, seen from {carrier.name}",
        chain=Chain(tuple(transforms), points, shift + arm.joints),
        compliance=np.concatenate(compliances),
        joint_limits=np.concatenate(limits),
        links=(),
        reported_matrix=block_diag(carrier.reported_matrix[::-1], arm.reported_matrix),
        reported_offset=np.concatenate(offsets),
        base_moves=True,
        compliance_known=carrier.compliance_known and arm.compliance_known,
    )


def _invert(chain: Chain) -> list[Transform]:
    """Invert a chain: its transforms backwards, with coordinates in their new order."""
    last = chain.coordinates - 1
    inverse = []
    for transform in reversed(chain.transforms):
        if transform.coordinate is None:
            inverse.append(replace(transform, constant=-transform.constant))
        else:
            backwards = last - transform.coordinate
            inverse.append(
                replace(transform, coordinate=backwards, sign=-transform.sign)
            )
    return inverse
