"""Diagnose a campaign in memory: what the model lacks, and the corrected robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.diagnosis.judge import generate_residual_blocks
from elastocal.errors import explain_missing_packages
from elastocal.interface.arguments import check_count, check_instance
from elastocal.interface.campaigns import CAMPAIGN_ALLOWED, Campaign
from elastocal.interface.corrected_robot import CorrectedRobot
from elastocal.loop.diagnosis_tables import (
    diagnose_with_proposal,
    tabulate_candidates,
    tabulate_parameters,
)
from elastocal.loop.schemas import drop_gross_errors
from elastocal.loop.whole import build_calibrated_robot, judge_and_predict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd

    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Judgement
    from elastocal.diagnosis.next_experiment import Table
    from elastocal.interface.plots import Plots
    from elastocal.verdict import Effect, ErrorSummary, NoiseEstimate, Verdict

# Seed of all random streams, that of config.yaml.
SEED = 1
# Number of poses of the next experiment, that of config.yaml.
PROPOSED_POSES = 10


@dataclass(frozen=True, eq=False)
class DiagnosisResult:
    """What a campaign says of its robot.

    Attributes
    ----------
    campaign : Campaign
        The measurements.
    verdict : Verdict
        Contents of verdict.json: effects, their probabilities, errors at held-out poses.
    robot : CorrectedRobot
        The robot with its calibrated model.
    next_experiment : dict
        Columns of the poses that would resolve what is left ambiguous.
    training : Diagnosis
        Result of the fitted poses.
    judgement : Judgement
        Result of the held-out poses.
    """

    campaign: Campaign
    next_experiment: Table = field(repr=False)
    training: Diagnosis = field(repr=False)
    judgement: Judgement = field(repr=False)

    @property
    def verdict(self) -> Verdict:
        """Contents of verdict.json."""
        return self.judgement.verdict

    @property
    def before(self) -> ErrorSummary:
        """Position errors at held-out poses of the robot that the user has, m."""
        return self.verdict.heldout.before

    @property
    def after(self) -> ErrorSummary:
        """Position errors at held-out poses of the corrected robot, m."""
        return self.verdict.heldout.delivered

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that the model lacked, the parts of the verdict."""
        return self.verdict.missing_effects

    @property
    def noise(self) -> NoiseEstimate:
        """Noise of the measurements."""
        return self.verdict.noise

    @cached_property
    def robot(self) -> CorrectedRobot:
        """The robot with its calibrated model."""
        calibrated = build_calibrated_robot(
            self.training, self.judgement.held_out, self.judgement.delivered
        )
        return CorrectedRobot(calibrated, self.verdict)

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Errors of each model on fitted and held-out poses, as before_after.csv."""
        import pandas as pd

        return pd.DataFrame(self.judgement.rows)

    @cached_property
    def candidates(self) -> pd.DataFrame:
        """Every effect that was tested, as candidates.csv."""
        import pandas as pd

        return pd.DataFrame(tabulate_candidates(self.training))

    @cached_property
    def residuals(self) -> dict[str, np.ndarray]:
        """Columns (N,) of the residuals before and after, as residuals.parquet but
        without gross errors."""
        blocks = [*generate_residual_blocks(self.training, self.judgement)]
        columns = {}
        for name in blocks[0]:
            columns[name] = np.concatenate([block[name] for block in blocks])
        return drop_gross_errors(columns)

    @property
    def plot(self) -> Plots:
        """Figures of the errors, the residuals and the candidates; they need the extra
        ``report``."""
        with explain_missing_packages():
            from elastocal.interface.plots import Plots

        return Plots(self)

    @cached_property
    def facts(self) -> dict[str, Any]:
        """Sentences and tables of the report."""
        from elastocal.report.loop_facts import collect_loop_facts

        proposed = self.next_experiment
        return collect_loop_facts(
            self.verdict,
            self.judgement.rows,
            [
                dict(zip(proposed, row, strict=True))
                for row in zip(*proposed.values(), strict=True)
            ],
            self.residuals,
            self.campaign.descriptions,
            {
                name: np.asarray(column)
                for name, column in tabulate_parameters(self.training.final).items()
            },
        )

    def report(self, path: str | Path) -> None:
        """Write the report as a PDF; needs the extra ``report``."""
        from elastocal.report.typesetting import compile_document

        with explain_missing_packages(), TemporaryDirectory() as folder:
            from elastocal.figures.style import save_all

            figures = save_all(self.plot.all(), folder)
            compile_document(path, "loop.typ", {"facts": self.facts}, figures.values())

    def __str__(self) -> str:
        return "\n".join(self.lines)

    @cached_property
    def lines(self) -> list[str]:
        """The outcome in a few lines, as the command prints it."""
        from elastocal.report.outcome import describe_verdict

        return describe_verdict(self.campaign.checked.name, self.verdict)

    def _repr_html_(self) -> str:
        from elastocal.interface.notebook import format_result

        return format_result(self)


def diagnose(
    campaign: Campaign,
    *,
    seed: int = SEED,
    proposed_poses: int = PROPOSED_POSES,
    report_progress: Callable[[str], None] | None = None,
) -> DiagnosisResult:
    """Find which effects the model of a robot lacks, and correct the robot.

    Parameters
    ----------
    campaign : Campaign
        Measurements, of which whole poses are held out to judge the result.
    seed : int
        Seed of all random streams; with that of config.yaml, the default, the result is
        that of `elastocal diagnose`.
    proposed_poses : int
        Number of poses of the next experiment.
    report_progress : callable, optional
        Takes a line on each stage.

    Returns
    -------
    DiagnosisResult
        Verdict, errors before and after at held-out poses, and the corrected robot.
    """
    check_instance("diagnose", "campaign", campaign, Campaign, CAMPAIGN_ALLOWED)
    check_count("diagnose", "seed", seed, 0)
    check_count("diagnose", "proposed_poses", proposed_poses, 1)
    fitted, held_out = campaign.split()
    training, experiment = diagnose_with_proposal(
        fitted, seed, proposed_poses, report_progress or _ignore
    )
    judgement = judge_and_predict(training, held_out, seed)
    return DiagnosisResult(campaign, experiment, training, judgement)


def _ignore(_line: str) -> None:
    """Ignore a line on the progress."""
