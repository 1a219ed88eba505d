"""What was declared wrongly rather than made inexactly: a target, a tool, a base, a
pedestal, links of another variant.

A fit takes up in lengths of links what a declaration has wrong by millimetres, and its
errors on held-out poses show nothing of it; but the flange is then elsewhere than the
reflector says. Along each axis of each place is asked whether a shift of any size
there, beside geometry of one usual size everywhere else, makes the measurements more
probable. The size of all else is the most probable one, as in `fitting.noise`: of a
robot that was made badly everywhere nothing is misplaced.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.fitting.model import get_parameter_values
from elastocal.fitting.noise import PRIOR_SCALES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Campaign, Target
    from elastocal.fitting.least_squares import Fit

# Usual sizes that a bad case reaches (`effects.sizes.Size.most`).
_MOST_SIZES = 3.0
# Least gain of the logarithm of the evidence: one declaration in twenty is wrong, along
# one of a dozen axes.
_LEAST_GAIN = 5.5
_MOST_AXES = 6
# Places that say it as well as the best, in the same unit.
_AS_WELL = 3.0
# What is declared wrongly is wrong by so much at least, m: millimetres, a mistaken
# digit; another variant by what was fitted.
_WRONG_M = 0.03
# Beyond such a turn, rad, the geometry is not linear, and what a fit has of it means
# nothing.
_LARGEST_TURN = 0.1
# From this share of its length on a shift is along one axis.
_ALONG = 0.95
TOOL = "tool"
BASE = "base"
_BASE = "base_placement"
_LINK = "link_geometry"
_OFFSET = "joint_offset"


def find_misplaced_frames(fitted: Fit, campaign: Campaign) -> list[dict[str, Any]]:
    """Findings, the surest first.

    Returns of each ``place``: "tool", "base" or "link 3"; ``alternatives``, which say
    it as well; ``shift_m`` (3,) in the axes of the base or of the far end of the link;
    ``sizes``, its length over the usual one; ``sentence``.
    """
    free = np.flatnonzero(~fitted.unidentifiable)
    effects = {effect.key: effect.effect for effect in fitted.model.effects}
    owners, listed = (
        zip(*(fitted.parameters[at] for at in free), strict=True)
        if len(free)
        else ((), ())
    )
    kinds = [effects.get(owner) for owner in owners]
    geometry = np.array([kind in (_BASE, _LINK, _OFFSET) for kind in kinds], bool)
    usual = np.array([parameter.plausible for parameter in listed])
    values = get_parameter_values(fitted.model, fitted.estimate)[free]
    shifts = [
        n
        for n, kind in enumerate(kinds)
        if kind in (_BASE, _LINK) and listed[n].unit == "m"
    ]
    turns = geometry & np.array([parameter.unit == "rad" for parameter in listed], bool)
    if (
        not shifts
        or (np.abs(values) < usual)[shifts].all()
        or (np.abs(values[turns]) > _LARGEST_TURN).any()
    ):
        return []
    wrong_m = max(_WRONG_M, float(np.abs(values[shifts]).max()))
    # What the measurements say, without the prior of the fit, and no more surely than
    # the model explains them.
    off = fitted.whiten(fitted.residual)
    misfit = max(1.0, float((off**2).sum()) / max(off.size - len(free), 1))
    precision = np.linalg.inv(fitted.covariance[np.ix_(free, free)])
    weighted = precision @ values
    precision[np.diag_indices(len(free))] -= np.where(
        geometry, fitted.prior_std[free] ** -2.0, 0.0
    )
    precision = precision / misfit
    weighted = weighted / misfit

    def explained(wrong: list[int]) -> tuple[float, np.ndarray]:
        """Log evidence with the most probable size of all else, but for a constant, and
        the parameters then."""
        found = []
        for size in PRIOR_SCALES:
            prior = size * usual
            prior[wrong] = wrong_m
            whole = precision + np.diag(np.where(geometry, prior**-2.0, 0.0))
            best = np.linalg.solve(whole, weighted)
            found.append(
                (
                    0.5 * (weighted @ best - np.linalg.slogdet(whole)[1])
                    - np.log(prior[geometry]).sum(),
                    best,
                )
            )
        return max(found, key=lambda each: each[0])

    reflector = any(target.offset_m is not None for target in _at_end(campaign))
    tool = f"{_LINK}@{campaign.robot.joints}" if reflector else ""
    places = {
        n: TOOL
        if owners[n] == tool
        else BASE
        if kinds[n] == _BASE
        else f"link {owners[n].split('@')[1]}"
        for n in shifts
    }
    taken: list[int] = []
    others: dict[str, set[str]] = {}
    last, at = explained(taken)
    # Along one axis of a place, or along all of them.
    ways: list[tuple[int, ...]] = [(n,) for n in shifts]
    ways += [
        tuple(n for n in shifts if places[n] == place) for place in set(places.values())
    ]
    while len(taken) < _MOST_AXES and (
        left := [way for way in ways if not set(way) & set(taken)]
    ):
        tried = {way: explained([*taken, *way]) for way in left}
        most = max(gain for gain, _ in tried.values())
        if most - last < _LEAST_GAIN:
            break
        # Of places that say it as well: targets and tools are misplaced before bases,
        # and these before links.
        alike = [way for way in tried if tried[way][0] > most - _AS_WELL]
        best = min(
            alike,
            key=lambda way: (
                {TOOL: 0, BASE: 1}.get(places[way[0]], 2),
                len(way),
                -tried[way][0],
            ),
        )
        last, at = tried[best]
        taken += best
        others.setdefault(places[best[0]], set()).update(
            places[way[0]] for way in alike
        )
    found = []
    for place, alternatives in others.items():
        mine = [n for n in taken if places[n] == place]
        shift = np.zeros(3)
        shift[["xyz".index(listed[n].name[-1]) for n in mine]] = at[mine]
        sizes = float(np.linalg.norm(shift) / usual[mine].max())
        if sizes > _MOST_SIZES:
            facts = {
                "place": place,
                "alternatives": sorted(alternatives - {place}),
                "shift_m": shift.tolist(),
                "sizes": sizes,
            }
            found.append(facts | {"sentence": _sentence(facts, campaign)})
    return found


def describe_reference_point(campaign: Campaign) -> str:
    """Of which point a corrected robot is known: that of its end effector, as the
    targets on it were declared."""
    end = campaign.robot.chain.end_effector.name
    targets = _at_end(campaign)
    if not targets:
        names = ", ".join(
            f"{target.name} on {target.point}" for target in campaign.targets
        )
        between = "what lies between is the robot file's."
        return f"All errors are those of {end}, on which no target was measured ({names}): {between}"
    fitted = ", whose offset was fitted"
    each = [
        t.name
        + (fitted if t.offset_m is None else f" at {_millimetres(t.offset_m)} of it")
        for t in targets
    ]
    return f"All errors are those of {end}, measured by the target {'; '.join(each)}."


def _at_end(campaign: Campaign) -> list[Target]:
    return [
        target
        for target in campaign.targets
        if target.point == campaign.robot.chain.end_effector.name
    ]


def _millimetres(at: Sequence[float] | np.ndarray) -> str:
    return f"({', '.join(f'{1e3 * value:.1f}' for value in at)}) mm"


def _sentence(facts: dict[str, Any], campaign: Campaign) -> str:
    shift = np.array(facts["shift_m"])
    place = facts["place"]
    end = campaign.robot.chain.end_effector.name
    largest = np.abs(shift).max()
    whole = np.linalg.norm(shift)
    along = (
        f"along {'xyz'[np.argmax(np.abs(shift))]}"
        if largest > _ALONG * whole
        else f"by {_millimetres(shift)}"
    )
    length = f"{1e3 * whole:.1f} mm"
    others = " or ".join(facts["alternatives"])
    text = f"{place} ends {length} from where the robot file has it, {along} of its far end: a wrong length, or another variant of"
    text += " the robot" + (
        ", or a wrong height of base or pedestal" if place == "link 1" else ""
    )
    if place == TOOL:
        text = f"reflector or tool sits {length} from where it is declared, {along} of {end}: the flange is not certified, the"
        text += " reflector is"
    elif place == BASE:
        text = (
            f"the base stands {length} from where it is declared, {along} of the base"
        )
    if others:
        text += f" (or it is {others}: these measurements do not distinguish them)"
    return f"{text}. It is {facts['sizes']:.0f} times what such a length is usually off"
