"""Step 8: the verdict, with the figures behind it."""

import numpy as np

from elastocal.attribution import Attribution, by_effect
from elastocal.compliance_check import compliance_warnings
from elastocal.fitting import discrepancy
from elastocal.lack_of_fit import lack_of_fit
from elastocal.model import joint_compliances
from elastocal.selection import parameter_slice
from elastocal.verdict import UNEXPLAINED, Evidence, word


def attributions_from(rivals, found, p_values):
    """Attributions from the columns of the rivals table.

    Parameters
    ----------
    rivals : dict of str to ndarray
    found : sequence of Candidate
    p_values : dict of str to float
        By the keys of the candidates found.

    Returns
    -------
    list of Attribution
    """
    attributions = []
    for name, members in by_effect(found).items():
        mine = rivals["found"] == name
        attributions.append(
            Attribution(
                name,
                members,
                min(p_values[member.key] for member in members),
                tuple(rivals["candidate"][mine]),
                rivals["angle_deg"][mine],
                rivals["bic_difference"][mine],
                rivals["parameters"][mine],
                int(rivals["found_parameters"][mine].max(initial=0)),
            )
        )
    return attributions


def candidate_columns(looks, rivals):
    """Columns of the candidates table: the first look at each candidate, and its angle to what was found."""
    first = looks["look"] == 0
    nearest = {}
    for key, angle in zip(rivals["candidate"], rivals["angle_deg"], strict=True):
        nearest[key] = min(angle, nearest.get(key, np.inf))
    taken = set(looks["candidate"][looks["chosen"]])
    columns = {name: values[first] for name, values in looks.items() if name not in ("look", "chosen")}
    columns["chosen"] = np.array([key in taken for key in columns["candidate"]])
    columns["angle_deg"] = np.array([nearest.get(key, np.nan) for key in columns["candidate"]])
    return columns


def concluded(case, noise_facts, declared, final, attributions, doubts, looks, rows, heldout, faults, warnings, foreseen):
    """The contents of verdict.json.

    Parameters
    ----------
    case : Case
    noise_facts : dict
        Of step 2.
    declared, final : Fit
    attributions : sequence of Attribution
    doubts : sequence of dict
        Fields of `law_check.Doubt`.
    looks : dict of str to ndarray
        Columns of the looks table.
    rows : sequence of dict
        Of before_after.csv.
    heldout : dict
    faults : sequence of dict
        Faults of the data.
    warnings : list of str
    foreseen : pair of float or None
        Shares of the residual that a forest predicts, before and after; see `explainable`.

    Returns
    -------
    dict
    """
    before, after = lack_of_fit(declared, case.observations), lack_of_fit(final, case.observations)
    tested = len(set(looks["candidate"][(looks["look"] == 0) & np.isfinite(looks["p_value"])]))
    decisive = [fault for fault in faults if fault["decisive"]]
    # Both over the same readings: where the model lacks much, the poses that show it most look wild to the declared model.
    missing = discrepancy(declared, case.observations, final.tame), final.discrepancy_m
    evidence = Evidence(tested, before, after, *missing, tuple(attributions), tuple(decisive), bool(doubts))
    said = word(evidence)
    gains, compliances = _gains(rows), _compliances(declared, final)
    return {
        "campaign": case.campaign.name,
        "verdict": said,
        "effects": [_fault_entry(fault) for fault in decisive]
        + [_effect_entry(attribution, doubts, final, gains) for attribution in attributions],
        "noise": noise_facts["noise"],
        "lack_of_fit": {
            "before": _fit_entry(before),
            "after": _fit_entry(after),
            "explained_share": _number(evidence.explained),
        },
        "predictable_share": {"before": foreseen[0], "after": foreseen[1]},
        "heldout": heldout,
        "compliance_urad_per_Nm": {name: (1e6 * values).tolist() for name, values in compliances.items()},
        "held": sorted({f"{o} {p.name}" for (o, p), held in zip(final.parameters, final.held, strict=True) if held}),
        "candidates_tested": tested,
        "warnings": [
            *noise_facts["warnings"],
            *_fault_warnings(faults),
            *warnings,
            *_doubt_warnings(doubts),
            *compliance_warnings(compliances["after"], compliances["std_error"], final.model.nominal_compliance),
            # What readings leave that are wrong in themselves says nothing of the model.
            *([] if decisive else _remainder(said, after, evidence)),
        ],
    }


def _effect_entry(attribution, doubts, final, gains):
    keys = [member.key for member in attribution.members]
    joints = sorted({joint for member in attribution.members for joint in member.joints})
    return {
        "name": attribution.effect,
        "family": attribution.members[0].family,
        "joints": joints,
        "members": keys,
        "parameters": [entry for member in attribution.members for entry in _parameters(member, final)],
        "p_value": attribution.p_value,
        "heldout_gain": gains.get(attribution.effect),
        "alternatives": list(attribution.alternatives),
        "doubts": [doubt for doubt in doubts if doubt["effect"] in keys],
        "angle_to_nearest_deg": _number(attribution.angle_deg.min()) if len(attribution.angle_deg) else None,
    }


def _parameters(member, final):
    values = np.concatenate(final.values_of(member.key))
    mine = parameter_slice(final, member.key)
    named = (*member.parameters, *member.shapes)
    return [
        {
            "name": f"{member.key} {parameter.name}",
            "value": float(value),
            "std_error": float(np.sqrt(final.covariance[index, index])),
            "unit": parameter.unit,
            "held": bool(final.held[index]),
        }
        for parameter, value, index in zip(named, values, mine, strict=True)
    ]


def _fault_entry(fault):
    return {
        "name": fault["name"],
        "family": "data",
        "joints": fault["joints"],
        "detail": fault["detail"],
        "parameters": [value | {"std_error": None} for value in fault["parameters"]],
        "p_value": None,
        "heldout_gain": None,
        "alternatives": list(fault.get("alternatives", ())),
        "doubts": [],
        "angle_to_nearest_deg": None,
    }


def _fault_warnings(faults):
    return [f"{fault['name']}: {fault['detail']}" for fault in faults if not fault["decisive"]]


def _doubt_warnings(doubts):
    return [
        f"{doubt['effect']} departs from its law, {doubt['departure']}: something akin to it may be missing" for doubt in doubts
    ]


def _remainder(said, after, evidence):
    if not after.rejected:
        return []
    ratio = f"{np.sqrt(after.ratio):.1f} times the noise"
    if said == UNEXPLAINED and not evidence.attributions:
        return [f"the residual is {ratio} and no effect of the catalogue stands out"]
    share = f"{100 * evidence.explained:.0f} % of the mean square beside it"
    return [f"what remains is {ratio}; the effects found explain {share}, so something else is still missing"]


def _gains(rows):
    """Share by which each step lowers the held-out RMS."""
    gains, last = {}, None
    for row in rows:
        if row["kind"] == "effect":
            gains[row["step"].removeprefix("+ ")] = float(1 - row["heldout_rms_m"] / last)
        if row["kind"] in ("declared", "effect"):
            last = row["heldout_rms_m"]
    return gains


def _compliances(declared, final):
    deviations = np.zeros(final.model.sites.joints)
    if final.model.identifies_compliance:
        deviations = np.sqrt(np.diag(final.covariance))[parameter_slice(final, "joint_compliance")]
    return {
        "before": joint_compliances(declared.model, declared.estimate),
        "after": joint_compliances(final.model, final.estimate),
        "std_error": deviations,
    }


def _fit_entry(fit):
    return {"mean_square_over_noise": _number(fit.ratio), "p_value": _number(fit.p_value), "rejected": fit.rejected}


def _number(value):
    return float(value) if np.isfinite(value) else None
