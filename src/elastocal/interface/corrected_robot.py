"""A robot with its calibrated model: where it goes, and commands that correct it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import (
    ErrorPrediction,
    predict_errors,
    select_campaign_commands,
)
from elastocal.application.calibrated import CalibratedRobot, predict_poses
from elastocal.application.exported import fold_effects, write_robot_file
from elastocal.application.mjcf import build_mjcf
from elastocal.application.model_file import (
    describe_model,
    read_model_file,
    restore_calibrated,
    write_model,
)
from elastocal.application.path_correction import CorrectedPath, correct_path
from elastocal.application.statements import format_millimetres
from elastocal.campaigns.measurements import ROTATION
from elastocal.errors import InputError
from elastocal.exchange.makers_kinematics import (
    correct_makers_file,
    find_deviation_m,
    read_makers_file,
)
from elastocal.exchange.measured_targets import (
    are_millimetres,
    arrange_corrected_targets,
    arrange_positions,
    read_corrected_targets,
    read_target_measurements,
)
from elastocal.exchange.target_path import (
    TargetPath,
    build_target_path,
    read_target_path_for,
)
from elastocal.exchange.urdf_writing import build_urdf, write_calibrated_origins
from elastocal.interface.arguments import check_array, check_instance, check_size
from elastocal.io.atomic_writes import write_atomically, write_text
from elastocal.loop.calibrated_files import decide_on_campaign
from elastocal.loop.verification import (
    Verification,
    get_targets,
    list_reflectors,
    verify_robot,
)
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from elastocal.mechanics.robot import Robot
    from elastocal.validation.conformity import Conformity
    from elastocal.verdict import Verdict

# What messages name as the source of a wrong argument.
_SOURCE = "CorrectedRobot"
# Upper bound on a tolerance: a larger one is in millimetres.
_LARGEST_TOLERANCE_M = 0.05
_TARGETS_ALLOWED = (
    "a result of CorrectedRobot.correct, or the file of elastocal correct"
)
_ROBOT_ALLOWED = "a CorrectedRobot, such as result.robot or ec.read_model returns"


@dataclass(frozen=True, eq=False)
class CorrectedRobot:
    """A robot with the model that a campaign has identified.

    Attributes
    ----------
    calibrated : CalibratedRobot
        The model with its uncertainty.
    verdict : Verdict
        The verdict on the campaign.
    """

    calibrated: CalibratedRobot = field(repr=False)
    verdict: Verdict = field(repr=False)

    def __repr__(self) -> str:
        effects = ", ".join(effect.name for effect in self.verdict.missing_effects)
        text = f"<CorrectedRobot {self.nominal.name}: {effects or 'no effect'}"
        accuracy = self.verdict.accuracy
        if accuracy is not None:
            text += f"; predicted error {format_millimetres(accuracy.rms_m)} RMS"
            if accuracy.rms_bound_m is not None:
                text += f", 95 % bound {format_millimetres(accuracy.rms_bound_m)}"
        return f"{text}>"

    @property
    def nominal(self) -> Robot:
        """The robot as it was declared."""
        return self.calibrated.robot

    def predict(
        self, joint_angles: ArrayLike, wrenches: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predict where the robot comes to rest.

        Parameters
        ----------
        joint_angles : (N, n) array
            Commands as the controller reports them, rad; of prismatic joints m.
        wrenches : (N, 6) array, optional
            Loads at the last measuring point, base axes, N and N m.

        Returns
        -------
        positions, rotations : (N, 3) array, m, and (N, 3, 3) array
            Pose of the last measuring point in the base frame.
        """
        angles, loads = self._check_commands(joint_angles, wrenches)
        return predict_poses(self.calibrated, angles, loads)

    def predict_errors(
        self, joint_angles: ArrayLike, wrenches: ArrayLike | None = None
    ) -> ErrorPrediction:
        """Predict the errors that remain at corrected commands; arguments as of
        `predict`."""
        return predict_errors(
            self.calibrated, *self._check_commands(joint_angles, wrenches)
        )

    def correct(
        self,
        path: str | Path | pd.DataFrame,
        *,
        allow_large_steps: bool = False,
        partial: bool = False,
    ) -> CorrectedPath:
        """Compute the commands that reach wanted poses.

        Parameters
        ----------
        path : str, path or DataFrame
            Wanted poses of the last measuring point, base frame: ``x, y, z`` in m and
            ``rx, ry, rz`` in rad; optionally ``fx..mz``, their loads, and ``q1..qn``,
            the posture.
        allow_large_steps : bool
            Whether joints may turn much farther than the path does.
        partial : bool
            Whether poses that cannot be corrected are left out.

        Returns
        -------
        CorrectedPath
            Its `table` has the joint targets with their predicted errors and bounds.

        Raises
        ------
        InputError
            Names the line, what was found and what is allowed.
        """
        source = "path"
        if isinstance(path, (str, Path)):
            wanted = read_target_path_for(path, self.nominal)
            source = str(path)
        else:
            wanted = _arrange_path(path, self.nominal.commands)
        return correct_path(
            self.calibrated,
            wanted,
            source,
            allow_large_steps=allow_large_steps,
            partial=partial,
        )

    def certify(self, tolerance_m: float, accepted_risk: float = 0.05) -> Conformity:
        """Decide whether the corrected robot keeps a tolerance, as predicted.

        Parameters
        ----------
        tolerance_m : float
            Largest allowed RMS position error over the poses of the campaign, m.
        accepted_risk : float
            Accepted probability of a wrong decision.
        """
        _check_tolerance("certify", tolerance_m, accepted_risk)
        commands = select_campaign_commands(self.calibrated)
        prediction = predict_errors(self.calibrated, *commands)
        decision, _ = decide_on_campaign(
            self.calibrated, self.verdict, prediction, tolerance_m, accepted_risk
        )
        return decision

    def verify(
        self,
        targets: CorrectedPath | str | Path,
        measured: ArrayLike | str | Path,
        *,
        tolerance_m: float | None = None,
        accepted_risk: float = 0.05,
    ) -> Verification:
        """Compare the corrected robot, measured at its targets, with its prediction.

        Parameters
        ----------
        targets : CorrectedPath, str or path
            Result of `correct`, or the CSV that `elastocal correct` has written.
        measured : (N, 3) array, str or path
            Position of the campaign's reflector on the end effector at each row of the
            targets' table, m, NaN where it was not measured; or a CSV with ``x, y, z``.
        tolerance_m : float, optional
            Largest allowed RMS position error, m.
        accepted_risk : float
            Accepted probability of a wrong decision.

        Returns
        -------
        Verification
            Its `document` has the errors before, predicted and measured, whether the
            prediction held, whether an error remains that repeats, and the decision on
            the tolerance; its `table` has a row for each target.

        Raises
        ------
        InputError
            Names the argument, or the file and line, what was found and what is allowed.
        """
        if tolerance_m is not None:
            _check_tolerance("verify", tolerance_m, accepted_risk)
        campaign_targets = [*get_targets(self.calibrated).values()]
        reflectors = list_reflectors(campaign_targets, self.nominal, "verify")
        kinds = (CorrectedPath, str, Path)
        check_instance("verify", "targets", targets, kinds, _TARGETS_ALLOWED)
        joints = self.nominal.commands
        if isinstance(targets, (str, Path)):
            corrected = read_corrected_targets(targets, joints)
        else:
            corrected = arrange_corrected_targets(targets.table, joints)
        if isinstance(measured, (str, Path)):
            measurements = read_target_measurements(
                measured, corrected, self.nominal, reflectors
            )
        else:
            position = check_array("verify", "measured", measured, (len(corrected), 3))
            measurements = arrange_positions(corrected, position, reflectors[0])
        if not len(measurements):
            raise InputError("verify", "measured", "no position", "measured targets")
        wanted = corrected.position[measurements.row]
        if are_millimetres(measurements.position, wanted):
            finding = "positions that spread much farther than the targets"
            raise InputError("verify", "measured", finding, "positions in metres")
        return verify_robot(
            self.calibrated, corrected, measurements, tolerance_m, accepted_risk
        )

    def save(self, path: str | Path) -> None:
        """Write the whole model, with its uncertainty and its verdict, as one JSON file.

        `read_model` reads it again, and the evaluators of `elastocal.evaluators` need
        nothing of this package; docs/model_file.md explains the format.

        Parameters
        ----------
        path : str or path
            Such as ``arm.elastocal.json``.

        Raises
        ------
        InputError
            An effect has no formula.
        """
        write_model(path, describe_model(self.calibrated, self.verdict))

    def to_robot_file(self, path: str | Path) -> tuple[str, ...]:
        """Write geometry, springs and weights as a robot file; return the names of the
        effects that no robot file can hold."""
        folded = fold_effects(self.calibrated)
        write_robot_file(path, folded, self.verdict.campaign)
        effects = self.calibrated.model.effects
        return tuple(effects[number].key for number in folded.left_out)

    def to_urdf(self, path: str | Path, original: str | Path | None = None) -> int:
        """Write a URDF, which holds the geometry alone.

        Parameters
        ----------
        path : str or path
            The URDF.
        original : str or path, optional
            The URDF from which the robot was read, of which only joint origins change.
            Without it a new one is written, with links without shapes.

        Returns
        -------
        int
            Number of joint origins that were changed or written.
        """
        folded = fold_effects(self.calibrated)
        if original is None:
            write_text(path, build_urdf(self.nominal, folded.robot))
            return self.nominal.joints + 1
        corrected = write_calibrated_origins(original, self.nominal, folded.robot)
        with write_atomically(path) as partial:
            Path(partial).write_bytes(corrected.content)
        return corrected.changed

    def to_kinematics_file(self, path: str | Path, original: str | Path) -> float:
        """Write the geometry as the kinematics file of a maker.

        Parameters
        ----------
        path : str or path
            The file.
        original : str or path
            Kinematics file of the same robot: ``calibration.yaml`` of the ROS drivers of
            Universal Robots, or ``kinematics.yaml`` of franka_description. The frames of
            its links and its hash are kept.

        Returns
        -------
        float
            Largest distance of the file's poses from those of the calibrated geometry, m:
            ratios of joints, and at Universal Robots an error behind the last joint,
            have no place in it.
        """
        made = read_makers_file(original)
        robots = (self.nominal, fold_effects(self.calibrated).robot)
        write_text(path, correct_makers_file(made, *robots))
        return find_deviation_m(read_makers_file(path), made, robots)

    def to_mjcf(self, path: str | Path) -> tuple[str, ...]:
        """Write a model of MuJoCo: springs of the joints as servos, those of base,
        bearings and flange as passive joints, weights as bodies; return the names of the
        effects that no rigid body has."""
        exported = build_mjcf(describe_model(self.calibrated, self.verdict))
        write_text(path, exported.text)
        return exported.left_out

    def _check_commands(
        self, joint_angles: ArrayLike, wrenches: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Check the shapes of commands and loads."""
        shape = (None, self.nominal.commands)
        angles = check_array(_SOURCE, "joint_angles", joint_angles, shape)
        if wrenches is None:
            return angles, np.zeros((len(angles), 6))
        return angles, check_array(_SOURCE, "wrenches", wrenches, (len(angles), 6))


def read_model(path: str | Path) -> CorrectedRobot:
    """Read a corrected robot from a model file.

    Parameters
    ----------
    path : str or path
        What `CorrectedRobot.save` has written.

    Raises
    ------
    InputError
        Names what was found and what is allowed.
    """
    contents = read_model_file(path)
    return CorrectedRobot(restore_calibrated(contents, path), contents.verdict)


def certify(
    robot: CorrectedRobot, tolerance_m: float, accepted_risk: float = 0.05
) -> Conformity:
    """Decide whether a corrected robot keeps a tolerance, as `CorrectedRobot.certify`."""
    check_instance("certify", "robot", robot, CorrectedRobot, _ROBOT_ALLOWED)
    return robot.certify(tolerance_m, accepted_risk)


def verify(
    robot: CorrectedRobot,
    targets: CorrectedPath | str | Path,
    measured: ArrayLike | str | Path,
    *,
    tolerance_m: float | None = None,
    accepted_risk: float = 0.05,
) -> Verification:
    """Compare a corrected robot, measured at its targets, with its prediction, as
    `CorrectedRobot.verify`."""
    check_instance("verify", "robot", robot, CorrectedRobot, _ROBOT_ALLOWED)
    return robot.verify(
        targets, measured, tolerance_m=tolerance_m, accepted_risk=accepted_risk
    )


def _check_tolerance(source: str, tolerance_m: float, accepted_risk: float) -> None:
    for argument, value in (
        ("tolerance_m", tolerance_m),
        ("accepted_risk", accepted_risk),
    ):
        check_size(source, argument, value)
    if not 0.0 < tolerance_m < _LARGEST_TOLERANCE_M:
        allowed = f"a length in metres, below {_LARGEST_TOLERANCE_M:g} m"
        raise InputError(source, "tolerance_m", repr(tolerance_m), allowed)
    if not 0.0 < accepted_risk < 1.0:
        allowed = "a probability"
        raise InputError(source, "accepted_risk", repr(accepted_risk), allowed)


def _arrange_path(table: pd.DataFrame, joints: int) -> TargetPath:
    """Arrange a table of wanted poses. Missing columns of its loads are zero."""
    import pandas as pd

    check_instance("correct", "path", table, pd.DataFrame, "a DataFrame or a file")
    pose = [*"xyz", *ROTATION]
    angles = list_joint_columns(joints)
    has_angles = any(name in table for name in angles)
    needed = pose + angles if has_angles else pose
    missing = next((name for name in needed if name not in table), None)
    if missing is not None:
        allowed = f"a table with {', '.join(needed)}"
        raise InputError("path", "", f"no column {missing!r}", allowed)
    if not len(table):
        raise InputError("path", "", "no row", "a row for each wanted pose")
    wrench = None
    if any(name in table for name in WRENCH_NAMES):
        loads = table.reindex(columns=[*WRENCH_NAMES], fill_value=0.0)
        wrench = check_array("path", "fx..mz", loads, (None, 6))
    start = None
    if has_angles:
        start = check_array("path", "q1..qn", table[angles], (None, joints))
    wanted = check_array("path", "x..rz", table[pose], (None, 6))
    return build_target_path(wanted, start, wrench)
