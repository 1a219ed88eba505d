"""Jacobians of 100,000 configurations against a Python loop over pinocchio, one thread
each."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from common import Row, interleaved, load_robot

from elastocal.mechanics.chain import Chain
from elastocal.mechanics.kinematics import compute_poses_and_jacobians

ROBOTS = ("kuka", "fanuc")
TARGET = 5
TOLERANCE = 1e-12


@dataclass(frozen=True)
class Setting:
    """How many configurations and repetitions."""

    configurations: int
    repetitions: int


FULL = Setting(100_000, 9)
SMALL = Setting(100, 1)


def rows(work: Path, setting: Setting) -> list[Row]:
    """Rows of the report, one for each robot; `work` is not used."""
    return [_row(name, setting) for name in ROBOTS]


def pinocchio_model(chain: Chain) -> tuple[pin.Model, int]:
    """Model of a chain whose joints turn in the positive sense, and the index of its
    end-effector frame."""
    joints = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
    model = pin.Model()
    parent = 0
    placement = pin.SE3.Identity()
    for transform in chain.transforms:
        step = transform.constant * np.eye(3)[transform.axis]
        placement = placement * (
            pin.SE3(np.eye(3), step)
            if transform.kind == "T"
            else pin.SE3(pin.exp3(step), np.zeros(3))
        )
        if transform.coordinate is not None:
            if (transform.kind, transform.sign) != ("R", 1.0):
                raise ValueError(
                    f"{transform}: not a joint that turns in the positive sense"
                )
            parent = model.addJoint(
                parent,
                joints[transform.axis](),
                placement,
                f"q{transform.coordinate + 1}",
            )
            placement = pin.SE3.Identity()
    return model, model.addFrame(
        pin.Frame("end-effector", parent, placement, pin.FrameType.OP_FRAME)
    )


def _row(name: str, setting: Setting) -> Row:
    chain = load_robot(name).chain
    angles = np.random.default_rng(1).uniform(
        -np.pi, np.pi, (setting.configurations, chain.coordinates)
    )
    model, frame = pinocchio_model(chain)
    data = model.createData()
    aligned = pin.LOCAL_WORLD_ALIGNED

    def loop() -> None:
        for q in angles:
            pin.computeFrameJacobian(model, data, q, frame, aligned)

    expected = np.stack(
        [pin.computeFrameJacobian(model, data, q, frame, aligned) for q in angles]
    )
    jacobians = compute_poses_and_jacobians(chain, angles, chain.end_effector)[2]
    np.testing.assert_allclose(jacobians, expected, rtol=0, atol=TOLERANCE)
    functions = {
        f"elastocal on {name}": lambda: compute_poses_and_jacobians(
            chain, angles, chain.end_effector
        ),
        "pinocchio": loop,
    }
    ours, theirs = map(min, interleaved(functions, setting.repetitions))
    how = (
        f"poses_and_jacobians on {setting.configurations} random configurations against"
        " pin.computeFrameJacobian in a Python loop, one thread,"
        f" minimum of {setting.repetitions}, Jacobians equal to {TOLERANCE:g}"
    )
    return Row.of_speedup(f"kinematics {name}", ours, theirs, TARGET, how)
