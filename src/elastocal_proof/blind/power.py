"""How large an effect must be to be found, beside the oracle that knows it; and what cannot be found at all."""

import pandas as pd

from elastocal_proof.blind.rates import headed, rate
from elastocal_proof.plant.defects import KINDS

ALL = "all"
_GROUPS = ("single", "outside")
_SHARES = ("detected", "held", "named", "oracle_detected")
_SIZES = ["signal_rms_um", "signal_over_noise", "times_plausible"]
_COLUMNS = ["robots", "group", "effect", "level", "level_of", "cases", "oracle_cases"]
_COLUMNS += [f"{name}{end}" for name in _SHARES for end in ("", "_low", "_high")] + _SIZES
_UNDETECTABLE = ["robots", "effect", "setting", "level", "reason", "hits", "cases", "rate", "low", "high"]
_UNDETECTABLE += ["wrong_name", "retained_share", "times_plausible"]


def powers(cases: pd.DataFrame) -> pd.DataFrame:
    """Detection against the size of the effect.

    `cases`: of `case_rows.case_row`. Returns one row for each kind of robots, group, effect and level, and ``all`` effects of a
    group together but those of which the model absorbs everything. What an oracle would do is empty for effects that no model
    of the catalogue has.
    """
    parts = cases[cases.group.isin(_GROUPS)]
    visible = parts[parts.level_of == "retained"].assign(truth=ALL)
    rows = []
    for keys, part in pd.concat([parts, visible]).groupby(["robots", "group", "truth", "level"]):
        known = part.oracle_detected.dropna()
        rows.append(
            dict(zip(("robots", "group", "effect", "level"), keys, strict=True))
            | {"level_of": part.level_of.iloc[0], "cases": len(part), "oracle_cases": len(known)}
            | headed("detected", rate(part.detected))
            | headed("held", rate(part.holds_truth))
            | headed("named", rate(part.named_right))
            | headed("oracle_detected", rate(known))
            | {
                "signal_rms_um": 1e6 * part.signal_rms_m.median(),
                "signal_over_noise": part.signal_over_noise.median(),
                "times_plausible": part.times_plausible.median(),
            }
        )
    return pd.DataFrame(rows, columns=_COLUMNS)


def undetectable(cases: pd.DataFrame) -> pd.DataFrame:
    """What cannot be found, with the reason.

    `cases`: of `case_rows.case_row`. Returns one row for each kind of robots, effect, setting and level of cases that are
    absorbed, whose covariate is not recorded, or that are larger than plausible in at least half of them.
    """
    rows = []
    parts = cases[(cases.group == "single") | cases.hidden]
    for keys, part in parts.groupby(["robots", "truth", "setting", "level"]):
        reason = _reason(part)
        if reason:
            rows.append(
                dict(zip(("robots", "effect", "setting", "level"), keys, strict=True))
                | {"reason": reason}
                | rate(part.detected)
                | {
                    "wrong_name": int(part.wrong_name.sum()),
                    "retained_share": (part.retained / part.raw).median() ** 0.5,
                    "times_plausible": part.times_plausible.median(),
                }
            )
    return pd.DataFrame(rows, columns=_UNDETECTABLE)


def _reason(part: pd.DataFrame) -> str:
    if (part.level_of == "raw").all():
        return "absorbed by the joint compliances"
    if part.hidden.all():
        needs = sorted({need for name in part.truth.iloc[0].split(" + ") for need in KINDS[name].needs})
        return f"needs {' and '.join(needs)}, not recorded"
    return "larger than plausible" if part.times_plausible.median() > 1.0 else ""
