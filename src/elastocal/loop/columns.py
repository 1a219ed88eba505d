"""Readings, estimates and searches to columns of tables and back."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaign import Readings
from elastocal.model import Estimate, parameters
from elastocal.screening import cross_validated_gains
from elastocal.selection import FOLDS
from elastocal.study.columns import COMPONENT_NAMES, WRENCH_NAMES

IDENTITY = ("session", "pose", "load", "repeat", "target", "row")
_FIT = "fit"


def reading_columns(readings):
    """Columns of the readings table."""
    count, joints = readings.joint_angles.shape
    columns = {name: getattr(readings, name) for name in IDENTITY}
    columns |= {f"q{j + 1}": readings.joint_angles[:, j] for j in range(joints)}
    columns |= dict(zip(WRENCH_NAMES, readings.wrench.T, strict=True))
    columns |= dict(zip("xyz", readings.position.T, strict=True))
    columns |= dict(zip(("rx", "ry", "rz"), _or_missing(readings.rotation_vector, (count, 3)).T, strict=True))
    approach = _or_missing(readings.approach, (count, joints))
    columns |= {f"approach{j + 1}": approach[:, j] for j in range(joints)}
    return columns | {name: _or_missing(getattr(readings, name), (count,)) for name in ("time_s", "temperature_c")}


def readings_from(columns):
    """Readings from the columns of their table."""
    joints = sum(name.startswith("approach") for name in columns)
    return Readings(
        **{name: columns[name] for name in IDENTITY},
        joint_angles=np.column_stack([columns[f"q{j}"] for j in range(1, joints + 1)]),
        wrench=np.column_stack([columns[name] for name in WRENCH_NAMES]),
        position=np.column_stack([columns[axis] for axis in "xyz"]),
        rotation_vector=_or_none(np.column_stack([columns[f"r{axis}"] for axis in "xyz"])),
        approach=_or_none(np.column_stack([columns[f"approach{j}"] for j in range(1, joints + 1)])),
        time_s=_or_none(columns["time_s"]),
        temperature_c=_or_none(columns["temperature_c"]),
    )


def parameter_columns(fitted):
    """Columns of the parameters table of a fit."""
    named = parameters(fitted.model, fitted.estimate)
    values = _absolute_values(fitted.model, fitted.estimate)
    return {
        "owner": [owner for owner, _ in named] + [_FIT],
        "parameter": [parameter.name for _, parameter in named] + ["discrepancy"],
        "unit": [parameter.unit for _, parameter in named] + ["m"],
        "value": np.append(values, fitted.discrepancy_m),
        "std_error": np.append(np.sqrt(np.diag(fitted.covariance)), np.nan),
        "held": np.append(fitted.held, False),
        "prior_std": np.array([np.nan if p.prior_std is None else p.prior_std for _, p in named] + [np.nan]),
    }


def correlation_columns(fitted):
    """Columns of the correlations table of a fit: every pair of parameters that are not held."""
    named = [f"{owner} {parameter.name}" for owner, parameter in parameters(fitted.model, fitted.estimate)]
    free = np.flatnonzero(~fitted.held)
    deviation = np.sqrt(np.diag(fitted.covariance))[free]
    correlation = fitted.covariance[np.ix_(free, free)] / np.outer(deviation, deviation)
    rows, columns = np.tril_indices(len(free), -1)
    return {
        "one": [named[free[row]] for row in rows],
        "other": [named[free[column]] for column in columns],
        "correlation": correlation[rows, columns],
    }


def estimate_from(columns, model, sessions):
    """The estimate of a model, and the discrepancy of its fit, from the columns of the parameters table.

    Parameters
    ----------
    columns : dict of str to ndarray
    model : Model
    sessions : sequence of int

    Returns
    -------
    Estimate
    discrepancy_m : float
    """
    values = {(o, p): v for o, p, v in zip(columns["owner"], columns["parameter"], columns["value"], strict=True)}

    def placed(owner, default):
        shift = [values.get((owner, name), missing) for name, missing in zip(("dx", "dy", "dz"), default, strict=True)]
        return shift, Rotation.from_rotvec([values.get((owner, name), 0.0) for name in ("rx", "ry", "rz")]).as_matrix()

    frames = [placed(f"frame {session}", (0.0, 0.0, 0.0)) for session in sessions]
    targets = [placed(f"target {target.name}", target.offset_m or (0.0, 0.0, 0.0)) for target in model.targets]
    estimate = Estimate(
        tuple(int(session) for session in sessions),
        np.array([turn for _, turn in frames]),
        np.array([shift for shift, _ in frames]),
        np.array([shift for shift, _ in targets]),
        np.array([turn for _, turn in targets]),
        tuple(np.array([values[effect.key, p.name] for p in effect.parameters]) for effect in model.effects),
        tuple(np.array([values[effect.key, s.name] for s in effect.shapes]) for effect in model.effects),
    )
    return estimate, float(values[_FIT, "discrepancy"])


def candidate_columns(candidates):
    """Columns that name candidates."""
    return {
        "candidate": [candidate.key for candidate in candidates],
        "effect": [candidate.effect for candidate in candidates],
        "family": [candidate.family for candidate in candidates],
        "joints": ["+".join(map(str, candidate.joints)) for candidate in candidates],
    }


def look_blocks(looks, candidates):
    """Blocks of the looks table, one for each look; the first also lists the candidates that could not be tested.

    Parameters
    ----------
    looks : sequence of Look
    candidates : dict of str to Candidate

    Yields
    ------
    dict
    """
    for number, look in enumerate(looks):
        tested = [candidate for candidate, _ in look.directions.candidates]
        left = [] if number else [candidates[key] for key in look.directions.untestable]
        count, untested = len(tested), np.full(len(left), np.nan)
        block = {"look": np.full(count + len(left), number)} | candidate_columns([*tested, *left])
        shapes = [values[0] if len(values) else np.nan for _, values in look.directions.candidates]
        block["shape"] = np.concatenate([shapes, untested])
        block["parameters"] = np.concatenate([look.scores.parameters, np.zeros(len(left))])
        for name in ("statistic", "p_value", "p_family", "bic_gain"):
            block[name] = np.concatenate([getattr(look.scores, name), untested])
        gains = np.full((2, count), np.nan)
        if count and not number:
            gains = np.array(cross_validated_gains(look.directions, range(count), FOLDS))
        for name, values in zip(("heldout_gain", "heldout_gain_std_error"), gains, strict=True):
            block[name] = np.concatenate([values, untested])
        block["retained"] = np.concatenate([look.directions.retained, untested])
        block["noncentrality"] = np.concatenate([look.directions.noncentrality, untested])
        block["chosen"] = np.arange(count + len(left)) == (-1 if look.chosen is None else look.chosen)
        refused = ["does not predict poses that were left out" if c.key in look.refused else "" for c in tested]
        block["note"] = refused + [look.directions.untestable[candidate.key] for candidate in left]
        yield block


def found_columns(search):
    """Columns of the found table."""
    chosen = {}
    for look in search.looks:
        if look.chosen is not None:
            key = look.directions.candidates[look.chosen][0].key
            chosen[key] = look.scores.p_family[look.chosen], look.gain, look.gain_std_error
    # What stands for several effects at once was not itself chosen in a look: the least of theirs is its p-value.
    least = min(chosen.values(), default=None)
    rows = np.array([chosen.get(candidate.key, least) for candidate in search.effects]).reshape(-1, 3)
    return candidate_columns(search.effects) | dict(zip(("p_family", "gain", "gain_std_error"), rows.T, strict=True))


def rival_blocks(attributions):
    """Blocks of the rivals table, one for each effect found."""
    for attribution in attributions:
        yield {
            "found": [attribution.effect] * len(attribution.rivals),
            "candidate": list(attribution.rivals),
            "angle_deg": attribution.angle_deg,
            "bic_difference": attribution.bic_difference,
            "parameters": attribution.rival_parameters,
            "found_parameters": np.full(len(attribution.rivals), attribution.found_parameters),
            "alternative": np.isin(attribution.rivals, attribution.alternatives),
        }


def confounding_columns(seen, angles):
    """Columns of the confounding table: every pair of tested candidates once."""
    keys = [candidate.key + (f" {values[0]:.3g}" if len(values) else "") for candidate, values in seen.candidates]
    rows, columns = np.tril_indices(len(keys), -1)
    return {
        "one": [keys[row] for row in rows],
        "other": [keys[column] for column in columns],
        "angle_deg": angles[rows, columns],
    }


def residual_columns(readings, held_out, position, before, after):
    """Columns of the residuals table."""
    count, joints = readings.joint_angles.shape
    columns = {name: getattr(readings, name) for name in IDENTITY}
    columns |= {"held_out": np.full(count, held_out), "time_s": _or_missing(readings.time_s, (count,))}
    columns |= {f"q{j + 1}": readings.joint_angles[:, j] for j in range(joints)}
    columns |= dict(zip(WRENCH_NAMES, readings.wrench.T, strict=True))
    columns |= dict(zip("xyz", position.T, strict=True))
    for stage, residual in (("before", before), ("after", after)):
        whole = np.full((count, 6), np.nan)
        whole[:, : residual.shape[1]] = residual
        columns |= {f"{stage}_{name}": whole[:, k] for k, name in enumerate(COMPONENT_NAMES)}
    return columns


def _absolute_values(model, estimate):
    parts = []
    if model.fitted_frames:
        for shift, turn in zip(estimate.frame_position, estimate.frame_rotation, strict=True):
            parts += [shift, Rotation.from_matrix(turn).as_rotvec()]
    for number, target in enumerate(model.targets):
        if target.offset_m is None:
            parts.append(estimate.target_offset[number])
            if model.rows == 6:
                parts.append(Rotation.from_matrix(estimate.target_rotation[number]).as_rotvec())
    effects = [part for pair in zip(estimate.coefficients, estimate.shapes, strict=True) for part in pair]
    return np.concatenate([*parts, *effects]) if parts or effects else np.zeros(0)


def _or_missing(values, shape):
    return np.full(shape, np.nan) if values is None else values


def _or_none(values):
    return None if np.isnan(values).all() else values
