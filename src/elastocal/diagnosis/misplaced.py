"""Find frames that were declared wrongly rather than made inexactly: a target, a tool,
a base, a pedestal, or links of another variant of the robot.

A fit absorbs a wrong declaration of millimetres in the lengths of links, and its errors
on held-out poses show nothing of it; but the flange is then not where the reflector
says. For each axis of each frame the question is whether a shift of any size there,
with geometry of one usual size everywhere else, makes the measurements more probable.
The size of all other geometry is the most probable one, as in `fitting.noise`: on a
robot that was made badly everywhere, nothing is misplaced.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from elastocal.fitting.model import get_parameter_values
from elastocal.fitting.noise import PRIOR_SCALES
from elastocal.verdict import MisplacedFrame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Campaign, Target
    from elastocal.fitting.least_squares import Fit

# A shift counts as a wrong declaration from this many usual sizes on, which is as much
# as a badly made robot reaches (`effects.sizes.Size.most`).
_MOST_SIZES = 3.0
# Least gain of the log evidence: one declaration in twenty is wrong, along one of a
# dozen axes.
_LEAST_GAIN = 5.5
_MOST_AXES = 6
# Shifts whose log evidence is this close to the best one explain the measurements as
# well.
_AS_WELL = 3.0
# Standard deviation of a wrong declaration, m: some millimetres for a mistaken digit,
# more for another variant. It is at least as large as the largest shift that was
# fitted.
_WRONG_M = 0.03
# If the fit has turned a frame by more than this, rad, the geometry is not linear and
# its parameters mean nothing.
_LARGEST_TURN = 0.1
# From this share of its length on, a shift is reported as along one axis.
_ALONG = 0.95
TOOL = "tool"
BASE = "base"
_BASE = "base_placement"
_LINK = "link_geometry"
_OFFSET = "joint_offset"


@dataclass(frozen=True)
class _FreeParameters:
    """The N free parameters of a fit.

    Attributes
    ----------
    values : (N,), m or rad
    usual_sizes : (N,), plausible sizes
    axes : for shifts "x", "y" or "z"; meaningless for the others
    is_geometry : (N,) bool, placements of the base, links and joint offsets
    is_turn : (N,) bool, turns among these
    frames : by index of a shift of the base or of a link, the frame that it moves
    """

    values: np.ndarray
    usual_sizes: np.ndarray
    axes: list[str]
    is_geometry: np.ndarray
    is_turn: np.ndarray
    frames: dict[int, str]

    @classmethod
    def of_fit(cls, fitted: Fit, campaign: Campaign) -> _FreeParameters:
        """Sort the free parameters of a fit."""
        free = np.flatnonzero(~fitted.unidentifiable)
        owners = [fitted.parameters[index][0] for index in free]
        parameters = [fitted.parameters[index][1] for index in free]
        effects = {effect.key: effect.effect for effect in fitted.model.effects}
        is_geometry = np.isin(
            [effects.get(owner, "") for owner in owners], (_BASE, _LINK, _OFFSET)
        )
        is_angle = np.array([p.unit == "rad" for p in parameters], bool)
        frames = {}
        for index, owner in enumerate(owners):
            effect = effects.get(owner)
            if effect in (_BASE, _LINK) and parameters[index].unit == "m":
                frames[index] = _name_frame(owner, effect, campaign)
        return cls(
            get_parameter_values(fitted.model, fitted.estimate)[free],
            np.array([parameter.plausible for parameter in parameters]),
            [parameter.name[-1] for parameter in parameters],
            is_geometry,
            is_geometry & is_angle,
            frames,
        )


def _name_frame(owner: str, effect: str, campaign: Campaign) -> str:
    """Name of the frame that the geometry of some owner moves. The last link's end is
    the tool if a target with a declared offset is on it."""
    has_tool = any(target.offset_m is not None for target in _end_targets(campaign))
    if has_tool and owner == f"{_LINK}@{campaign.robot.joints}":
        return TOOL
    if effect == _BASE:
        return BASE
    return f"link {owner.partition('@')[2]}"


@dataclass(frozen=True)
class _Explanation:
    """Measurements explained with some shifts declared wrongly.

    `log_evidence`: with the most probable size of all other geometry, up to a constant.
    `values` (N,): most probable parameters.
    """

    log_evidence: float
    values: np.ndarray


@dataclass(frozen=True)
class _NormalEquations:
    """Normal equations of the measurements, without the prior of the geometry.

    Attributes
    ----------
    parameters : the N free parameters
    precision : (N, N)
    score : (N,), precision times the estimate
    wrong_m : standard deviation of a shift that was declared wrongly, m
    """

    parameters: _FreeParameters
    precision: np.ndarray
    score: np.ndarray
    wrong_m: float

    @classmethod
    def of_fit(cls, fitted: Fit, parameters: _FreeParameters) -> _NormalEquations:
        """Normal equations of a fit.

        The noise is scaled up if the model does not explain the measurements.
        """
        free = np.flatnonzero(~fitted.unidentifiable)
        residual = fitted.whiten(fitted.residual)
        degrees_of_freedom = max(residual.size - len(free), 1)
        misfit = max(1.0, float((residual**2).sum()) / degrees_of_freedom)
        precision = np.linalg.inv(fitted.covariance[np.ix_(free, free)])
        score = precision @ parameters.values
        precision[np.diag_indices(len(free))] -= np.where(
            parameters.is_geometry, fitted.prior_std[free] ** -2.0, 0.0
        )
        largest_m = float(np.abs(parameters.values[list(parameters.frames)]).max())
        return cls(
            parameters, precision / misfit, score / misfit, max(_WRONG_M, largest_m)
        )

    def explain(self, wrong: Sequence[int]) -> _Explanation:
        """Explain the measurements with some shifts declared wrongly, and all other
        geometry of its most probable size."""
        is_geometry = self.parameters.is_geometry
        explanations = []
        for size in PRIOR_SCALES:
            prior_std = size * self.parameters.usual_sizes
            prior_std[list(wrong)] = self.wrong_m
            precision = self.precision + np.diag(
                np.where(is_geometry, prior_std**-2.0, 0.0)
            )
            factors = lu_factor(precision)
            values = lu_solve(factors, self.score)
            log_det = np.log(np.abs(np.diag(factors[0]))).sum()
            log_evidence = (
                0.5 * (self.score @ values - log_det)
                - np.log(prior_std[is_geometry]).sum()
            )
            explanations.append(_Explanation(log_evidence, values))
        return max(explanations, key=lambda explanation: explanation.log_evidence)


def find_misplaced_frames(fitted: Fit, campaign: Campaign) -> list[MisplacedFrame]:
    """Find the frames that were declared wrongly, the surest first.

    Parameters
    ----------
    fitted : fit of the declared model, with geometry
    campaign : its campaign

    Returns
    -------
    Frames; a shift is in the axes of the base, or of the far end of the link. None if
    the measurements contain no length: a smaller robot touches unknown planes and places
    more exactly, so a wrong length would explain any error
    """
    if not campaign.measuring.shows_lengths(campaign.measurements.position):
        return []
    parameters = _FreeParameters.of_fit(fitted, campaign)
    is_usual = np.abs(parameters.values) < parameters.usual_sizes
    largest_turn = np.abs(parameters.values[parameters.is_turn]).max(initial=0.0)
    if is_usual[list(parameters.frames)].all() or largest_turn > _LARGEST_TURN:
        return []
    wrong, values, alternatives = _find_wrong_shifts(
        _NormalEquations.of_fit(fitted, parameters)
    )
    misplaced = []
    for frame, alternative_frames in alternatives.items():
        indices = [n for n in wrong if parameters.frames[n] == frame]
        shift_m = np.zeros(3)
        axes = ["xyz".index(parameters.axes[n]) for n in indices]
        shift_m[axes] = values[indices]
        usual_m = parameters.usual_sizes[indices].max()
        sizes = float(np.linalg.norm(shift_m) / usual_m)
        if sizes > _MOST_SIZES:
            sentence = _describe_frame(
                frame, alternative_frames, shift_m, sizes, campaign
            )
            misplaced.append(
                MisplacedFrame(
                    frame, alternative_frames, tuple(shift_m.tolist()), sizes, sentence
                )
            )
    return misplaced


def _find_wrong_shifts(
    equations: _NormalEquations,
) -> tuple[list[int], np.ndarray, dict[str, tuple[str, ...]]]:
    """Declare shifts as wrong, one after the other, as long as each makes the
    measurements more probable.

    Returns
    -------
    indices : of the parameters of these shifts
    values : (N,), most probable parameters with these shifts
    alternatives : by frame, the other frames whose shift explains the measurements as
        well
    """
    frames = equations.parameters.frames
    wrong: list[int] = []
    equivalent_frames: dict[str, set[str]] = {}
    explanation = equations.explain(wrong)
    while len(wrong) < _MOST_AXES:
        tried = {
            shift: equations.explain([*wrong, *shift])
            for shift in _list_shifts(frames)
            if not set(shift) & set(wrong)
        }
        most = max((e.log_evidence for e in tried.values()), default=-np.inf)
        if most - explanation.log_evidence < _LEAST_GAIN:
            break
        equivalent = {
            shift: explained
            for shift, explained in tried.items()
            if explained.log_evidence > most - _AS_WELL
        }
        shift = _choose_shift(equivalent, frames)
        explanation = tried[shift]
        wrong += shift
        equivalent_frames.setdefault(frames[shift[0]], set()).update(
            frames[indices[0]] for indices in equivalent
        )
    alternatives = {
        frame: tuple(sorted(equivalent - {frame}))
        for frame, equivalent in equivalent_frames.items()
    }
    return wrong, explanation.values, alternatives


def _list_shifts(frames: dict[int, str]) -> list[tuple[int, ...]]:
    """Ways to shift a frame, as indices of parameters: along one axis, or along all."""
    single = [(index,) for index in frames]
    whole: dict[str, tuple[int, ...]] = {}
    for index, frame in frames.items():
        whole[frame] = (*whole.get(frame, ()), index)
    return list(dict.fromkeys([*single, *whole.values()]))


def _choose_shift(
    equivalent: dict[tuple[int, ...], _Explanation], frames: dict[int, str]
) -> tuple[int, ...]:
    """Choose among shifts that explain the measurements as well as each other.

    Targets and tools are misplaced more often than bases, and these more often than
    links; a shift along one axis is simpler than one along all.
    """
    order = {TOOL: 0, BASE: 1}
    return min(
        equivalent,
        key=lambda shift: (
            order.get(frames[shift[0]], 2),
            len(shift),
            -equivalent[shift].log_evidence,
        ),
    )


def describe_reference_point(campaign: Campaign) -> str:
    """Say to which point the errors of a corrected robot refer: that of its end
    effector, as the targets on it were declared."""
    end = campaign.robot.chain.end_effector.name
    targets = _end_targets(campaign)
    if not targets:
        names = ", ".join(
            f"{target.name} on {target.point}" for target in campaign.targets
        )
        between = "the distance between them is that of the robot file."
        return (
            f"Errors refer to point {end}, on which no target was measured ({names}): "
            f"{between}"
        )
    descriptions = []
    for target in targets:
        if target.offset_m is None:
            descriptions.append(f"{target.name}, whose offset was fitted")
        else:
            offset = _format_millimetres(target.offset_m)
            uncertainty = ""
            if target.has_inexact_offset:
                uncertainty = f", known to {1e3 * target.offset_std_m:.2g} mm"
            descriptions.append(f"{target.name}, offset {offset}{uncertainty}")
    return f"Errors refer to point {end} (target {'; '.join(descriptions)})."


def _end_targets(campaign: Campaign) -> list[Target]:
    """Targets on the measuring point of the end effector."""
    end = campaign.robot.chain.end_effector.name
    return [target for target in campaign.targets if target.point == end]


def _format_millimetres(vector_m: Sequence[float] | np.ndarray) -> str:
    return f"({', '.join(f'{1e3 * value:.1f}' for value in vector_m)}) mm"


def _describe_frame(
    frame: str,
    alternatives: tuple[str, ...],
    shift_m: np.ndarray,
    sizes: float,
    campaign: Campaign,
) -> str:
    """What a report says of a misplaced frame; arguments as of `MisplacedFrame`."""
    length_m = np.linalg.norm(shift_m)
    length = f"{1e3 * length_m:.1f} mm"
    direction = f"by {_format_millimetres(shift_m)}"
    axis = np.argmax(np.abs(shift_m))
    if np.abs(shift_m[axis]) > _ALONG * length_m:
        direction = f"along {'xyz'[axis]}"
    if frame == TOOL:
        end = campaign.robot.chain.end_effector.name
        text = (
            f"reflector or tool sits {length} from where it is declared, {direction} of {end}: "
            "results hold for the reflector, not for the flange"
        )
    elif frame == BASE:
        text = f"the base stands {length} from where it is declared, {direction} of the base"
    else:
        text = (
            f"{frame} ends {length} from where the robot file has it, {direction} of its far end: "
            "a wrong length, or another variant of the robot"
        )
        if not campaign.measuring.is_tracked:
            # Lengths of the instrument bend the robot as its own lengths do.
            text += ", or a board or a distance of another size than stated"
        if frame == "link 1":
            text += ", or a wrong height of base or pedestal"
    if alternatives:
        names = " or ".join(alternatives)
        text += f" (or it is {names}: these measurements do not distinguish them)"
    return f"{text}. It is {sizes:.0f} times the usual error of such a length"
