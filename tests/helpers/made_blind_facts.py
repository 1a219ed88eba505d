"""Facts of the blind report made up for its tests, from tables that are written and read again as the pipeline does."""

import pandas as pd
from made_blind_documents import effect, frame, oracle, silence, truth, verdict

from elastocal_proof.blind.calibration import statements
from elastocal_proof.blind.confusion import confused
from elastocal_proof.blind.coverage import covered, intervals_of
from elastocal_proof.blind.power import powers, undetectable
from elastocal_proof.blind.targets import by_setting, summarized
from elastocal_proof.report.blind_facts import blind_facts

PAYLOAD = verdict("named", effect("payload"))
SWEEP = ["pair", "angle_up_to_deg", "cases"]
SWEEP += [f"{name}{end}" for name in ("right", "class", "wrong", "other") for end in ("", "_low", "_high")]
MANIFEST = "aa  case_x.json\n"
FOLLOW_UP = ["robots", "arm", "poses_added", "cases", "right_name", "low", "high"]


def scale():
    document = truth(("force_scale",))
    document["defects"][0]["of"] = "raw"
    return document


def tables(folder, *entries, follow_up=(), sweep=()):
    """As the pipeline has them: written and read again."""
    cases = frame(*entries)
    intervals = pd.DataFrame([row for document, found, _ in entries for row in intervals_of(document, found)])
    made = {
        "cases": cases,
        "summary": summarized(cases, intervals, statements((document, found) for document, found, _ in entries), 1),
        "settings": by_setting(cases),
        "confusion": confused(cases),
        "power": powers(cases),
        "coverage": covered(intervals),
        "undetectable": undetectable(cases),
        "follow_up": pd.DataFrame(follow_up, columns=FOLLOW_UP),
        "sweep": pd.DataFrame(sweep, columns=SWEEP),
    }
    for name, table in made.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    return {name: pd.read_csv(folder / f"{name}.csv") for name in made}


def facts_of(folder, *entries, **options):
    return blind_facts(tables(folder, *entries, **options), MANIFEST, "quick", 7)


PROOF = (
    *[(truth(), silence(), oracle(1.0))] * 3,
    (truth(("payload",)), PAYLOAD, oracle()),
    (truth(("payload",)), silence(), oracle()),
    (truth(("outside:refraction",), group="outside", level=200.0), PAYLOAD, None),
    (scale(), silence(), oracle(1.0)),
    (truth(("payload",), robot="kuka"), PAYLOAD, oracle()),
)
MEASURED = [("proof", "proposed", 5, 12, 0.75, 0.43, 0.95)]
