"""Figures of a diagnosis, whole or on axes of the caller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from elastocal.errors import InputError
from elastocal.figures.loop import (
    METRICS,
    VIEWS,
    draw_before_after,
    draw_hypotheses,
    draw_model_errors,
    draw_probabilities,
    draw_residual_arrows,
    draw_residual_view,
)
from elastocal.loop.schemas import find_worst_joint_angles
from elastocal.mechanics.kinematics import locate_corners

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.interface.diagnoses import DiagnosisResult


@dataclass(frozen=True, eq=False)
class Plots:
    """Figures of a diagnosis.

    Attributes
    ----------
    result : DiagnosisResult
        The diagnosis.
    """

    result: DiagnosisResult

    def errors(self, axes: Axes | None = None, metric: str = "rms") -> Figure:
        """Draw the errors of each model at held-out poses.

        Parameters
        ----------
        axes : Axes, optional
            On which one error is drawn; without them a figure of all errors.
        metric : str
            The error on given axes: "mean", "rms", "p95" or "max".
        """
        if metric not in METRICS:
            allowed = ", ".join(map(repr, METRICS))
            raise InputError("errors", "metric", repr(metric), allowed)
        rows = self.result.judgement.rows
        noise_floor_m = self.result.verdict.heldout.noise_floor_rms_m
        if axes is None:
            return draw_before_after(rows, noise_floor_m)
        draw_model_errors(axes, rows, metric, noise_floor_m)
        return _get_figure(axes)

    def residuals(
        self, axes: Axes | None = None, view: str = "from the side"
    ) -> Figure:
        """Draw the residuals before and after as arrows.

        Parameters
        ----------
        axes : Axes, optional
            On which one view is drawn; without them a figure of both views.
        view : str
            The view on given axes: "from the side" or "from above".
        """
        if view not in VIEWS:
            allowed = " or ".join(map(repr, VIEWS))
            raise InputError("residuals", "view", repr(view), allowed)
        robot = self.result.campaign.robot
        table = self.result.residuals
        angles = find_worst_joint_angles(table, robot.joints)
        arm = locate_corners(robot.chain, angles)
        if axes is None:
            return draw_residual_arrows(table, arm)
        draw_residual_view(axes, table, arm, view)
        return _get_figure(axes)

    def candidates(self, axes: Axes | None = None) -> Figure:
        """Draw how probable each hypothesis is; without given axes the Bayes factors of
        single candidates too."""
        posterior = self.result.verdict.probabilities
        if axes is not None and posterior is not None:
            draw_hypotheses(axes, posterior)
            return _get_figure(axes)
        table = self.result.candidates
        columns = {str(name): table[name].to_numpy() for name in table}
        return draw_probabilities(posterior, columns)

    def all(self) -> dict[str, Figure]:
        """Draw the figures of the report, by their names there."""
        return {
            "before_after": self.errors(),
            "arrows": self.residuals(),
            "candidates": self.candidates(),
        }


def _get_figure(axes: Axes) -> Figure:
    """Get the whole figure to which axes belong."""
    figure: Figure = axes.figure.figure
    return figure
