"""Other ways to read the file, compared by how well the data then fit.

One scan over the list of hypotheses, where the measurements as written are absurdly far from the nominal robot. The simplest
that mends them is named: one discrete change, or else a base or targets that stand elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.data_checks.hypotheses import POSES, Hypothesis, discrete, fitted, shifts
from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    of_each_target,
    placed,
    rms,
    robustly_placed,
    spread,
    trimmed_rms,
)
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from elastocal.campaigns.campaign import Campaign, Target
    from elastocal.data_checks.placement import Placement
    from elastocal.fitting.model import Estimate

    # Of distances or angles (N,).
    Measure = Callable[[np.ndarray], float]

_IMPLAUSIBLE = np.array([IMPLAUSIBLE_M, IMPLAUSIBLE_RAD])
# What a correction leaves as it is may come out this much larger by chance.
_NO_WORSE = 1.2
# Hypotheses whose misfits differ by less than this share, or by less than a tracker could tell, fit alike; so many are said.
_ALIKE, _ALIKE_M, _MOST_ALIKE = 1.1, 1e-4, 5
# A base that stands less far off than this may be the zero of the first joint or the height of the column: for physics to
# tell, and a warning here. Ten times what geometric errors of industrial robots reach.
_NEAR_M, _NEAR_RAD = 0.05, 0.05


@dataclass(frozen=True)
class Interpretation:
    """A campaign read by a hypothesis, and where it then lies beside the nominal robot."""

    hypothesis: Hypothesis
    campaign: Campaign
    placement: Placement

    def misfit(self, measure: Measure) -> np.ndarray:
        """What is left of positions (m) and orientations (rad) of the target that fits worst, ndarray (2,)."""
        targets, left = self.campaign.measurements.target, (self.placement.distance, self.placement.turn)
        each = [targets == target for target in np.unique(targets)]
        return np.array([0.0 if part is None else max(measure(part[mine]) for mine in each) for part in left])


def other_interpretations(campaign: Campaign) -> list[Fault]:
    """The simplest way to read the file otherwise that lets absurd measurements fit, beside those that fit as well; or none."""
    few, by_rows, loaded = spread(campaign, POSES), shifts(campaign), campaign.measurements.load > 0
    found = _mended(few, [*discrete(few), *by_rows], fitted(few))
    if found or not loaded.any():
        return found
    # Rows of one pose that stand a row off show it at the last load alone, where the next pose's stand.
    return _mended(spread(replace(campaign, measurements=campaign.measurements.select(loaded)), POSES), by_rows)


def _mended(campaign: Campaign, *tried: Sequence[Hypothesis]) -> list[Fault]:
    """Fault of the hypothesis that mends the measurements: of the first list, unless one of the next is far better."""
    written = _read(campaign, Hypothesis("", "", lambda same: same), robustly_placed)
    # All measurements but a few, or all: a joint may move in a few poses only.
    measures = [measure for measure in (trimmed_rms, rms) if (written.misfit(measure) > _IMPLAUSIBLE).any()]
    lists = [[_read(campaign, each, placed) for each in some] for some in tried if some] if measures else []
    for measure in measures:
        best: list[tuple[float, Fault]] = []
        for left, fault in filter(None, (_best(written, interpretations, measure) for interpretations in lists)):
            if not best or left < best[-1][0] / FAR_BETTER:
                best.append((left, fault))
        if best:
            return [best[-1][1]]
    return []


def _read(campaign: Campaign, hypothesis: Hypothesis, place: Callable[[Campaign], Placement]) -> Interpretation:
    read = hypothesis.read(campaign)
    return Interpretation(hypothesis, read, place(read))


def _length(misfit: np.ndarray) -> float:
    """What is left of positions and orientations together, m."""
    return float(np.hypot(misfit[0], IMPLAUSIBLE_M / IMPLAUSIBLE_RAD * misfit[1]))


def _best(written: Interpretation, interpretations: Sequence[Interpretation], measure: Measure) -> tuple[float, Fault] | None:
    """Fault of the first of those that fit best, if it convinces, beside what fits alike; and what it leaves, m."""
    before = written.misfit(measure)
    together = np.array([_length(interpretation.misfit(measure)) for interpretation in interpretations])
    alike = np.flatnonzero(together <= max(_ALIKE * together.min(), together.min() + _ALIKE_M))
    hypothesis = interpretations[alike[0]].hypothesis
    best = _read(written.campaign, hypothesis, robustly_placed)
    after, estimate = best.misfit(measure), best.placement.estimate
    evidence = _evidence(before, after, best)
    if evidence is None:
        return None
    detail, decisive = hypothesis.detail, True
    if detail == "frame":
        detail, decisive = _elsewhere(estimate, _length(before) / max(_length(after), 1e-12))
    elif detail == "targets":
        detail, decisive = _other_targets(written.placement.estimate, estimate, best.campaign.targets)
    poses = Value("poses compared", float(len(np.unique(best.campaign.measurements.pose))), "–")
    others = tuple(interpretations[n].hypothesis.detail for n in alike[1 : 1 + _MOST_ALIKE])
    return _length(after), Fault(hypothesis.name, hypothesis.joints, detail, (poses,), evidence, (), decisive, others)


def _evidence(before: np.ndarray, after: np.ndarray, interpretation: Interpretation) -> tuple[float, float] | None:
    """RMS before and after, of positions or else of orientations; None where a correction does not convince."""
    position, measurements = interpretation.placement.predicted[0], interpretation.campaign.measurements
    predicted = [position[members] for members in of_each_target(measurements)]
    extent = max(rms(np.linalg.norm(points - points.mean(axis=0), axis=1)) for points in predicted)
    # Where the robot hardly moves, anything that gathers the measurements in one place would fit.
    limit = np.minimum(before / FAR_BETTER, np.minimum(_IMPLAUSIBLE, [extent / FAR_BETTER, np.inf]))
    better = (before > _IMPLAUSIBLE) & (after < limit)
    no_worse = after <= np.maximum(_NO_WORSE * before, _IMPLAUSIBLE)
    for one, other in ((0, 1), (1, 0)):
        if better[one] and no_worse[other]:
            return float(before[one]), float(after[one])
    return None


def _elsewhere(fitted_frames: Estimate, better: float) -> tuple[str, bool]:
    """Sentence of a base that stands elsewhere, of several sessions the farthest, and whether that is too far for physics."""
    away = float(np.linalg.norm(fitted_frames.frame_position, axis=1).max())
    turned = float(Rotation.from_matrix(fitted_frames.frame_rotation).magnitude().max())
    distance = f"{away:.3g} m" if away >= 0.1 else f"{1e3 * away:.2g} mm"
    where = f"{distance} away, turned by {np.degrees(turned):.3g}°"
    if away > _NEAR_M or turned > _NEAR_RAD:
        return f"measurements do not lie in the base frame: the robot would stand {where}", True
    return f"measurements would fit {better:.0f} times better if the base stood {where}", False


def _other_targets(before: Estimate, after: Estimate, targets: Sequence[Target]) -> tuple[str, bool]:
    """Sentence of targets that sit elsewhere or are turned, with the remedy, and whether that is too far for physics."""
    turns = Rotation.from_matrix(before.target_rotation.transpose(0, 2, 1) @ after.target_rotation).magnitude()
    away = np.linalg.norm(after.target_offset - before.target_offset, axis=1)
    found = {}
    if away.max() > IMPLAUSIBLE_M or turns.max() <= IMPLAUSIBLE_RAD:
        found["offset_m"] = f"{targets[int(np.argmax(away))].name} would sit {1e3 * away.max():.3g} mm from there"
    if turns.max() > IMPLAUSIBLE_RAD:
        found["rotation"] = f"{targets[int(np.argmax(turns))].name} would be turned by {np.degrees(turns.max()):.3g}°"
    remedy = " and ".join(f"{key}: unknown" for key in found)
    fits = f"where its mount is not as stated, {remedy} in campaign.yaml fits it, and known values may stand there"
    # A target that sits a little off may as well be a last link of another length.
    decisive = "rotation" in found or bool(away.max() > _NEAR_M)
    return f"targets do not sit where the campaign says: {' and '.join(found.values())}; {fits}", decisive
