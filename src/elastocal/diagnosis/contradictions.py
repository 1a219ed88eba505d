"""What forbids to call a declared model adequate, although no alarm is raised against it.

The alarm asks whether a mechanism explains the measurements better than noise does. Noise that is estimated along with the
model may swallow a misfit, and a parameter may do so at a value that no robot has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.displacement import joint_compliances

if TYPE_CHECKING:
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.noise import Noise


def contradictions(final: Fit, measured: Noise, settings: Settings) -> list[str]:
    """A sentence for each; ``measured`` is the noise as repeats or the sensor have it, before the model was fitted."""
    # Noise that somebody declared may be a guess, and a warning says that it is far off.
    found = scatter_warnings(final.noise, measured, settings.largest_scatter) if measured.source == "repeats" else []
    found += pose_error_warnings(final.noise, settings.largest_pose_error_rad)
    if final.model.identifies_compliance:
        compliance = joint_compliances(final.model, final.estimate)
        deviation = np.sqrt(np.diag(final.covariance))[final.places_of("joint_compliance")]
        found += [
            f"the compliance of joint {joint + 1} is negative by {-compliance[joint] / deviation[joint]:.1f} standard errors"
            for joint in np.flatnonzero(compliance < -settings.negative_compliance * deviation)
        ]
    return found


def scatter_warnings(left: Noise, measured: Noise, least: float) -> list[str]:
    """A sentence where a model leaves at least so many times the noise that was measured or declared."""
    factor = left.position_m / measured.position_m
    if factor < least:
        return []
    reference = "their repeats about each other" if measured.source == "repeats" else "the noise that is declared for them"
    return [f"measurements scatter about the model {factor:.{0 if factor > 10 else 1}f} times as much as {reference}"]


def pose_error_warnings(left: Noise, least_rad: float) -> list[str]:
    """A sentence where measurements of a pose have at least such an error in common."""
    if left.pose_rad < least_rad:
        return []
    return [
        f"measurements of a pose err together as if every joint were {1e6 * left.pose_rad:.0f} µrad off, which repeats of a"
        " pose do not show: new poses will err as much"
    ]
