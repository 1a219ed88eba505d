"""Facts of the loop report made up for its tests: one campaign of every verdict, and what its report states."""

from made_loop_tables import (
    campaign_descriptions,
    effect_entry,
    fault_entry,
    parameter_table,
    remainder_facts,
    residual_table,
    step_rows,
    verdict_document,
)

from elastocal.diagnosis.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL, UNEXPLAINED
from elastocal.report.loop_facts import loop_facts

HARMONICS = [f"transmission_harmonic@{joint}[orders {band}]" for joint in range(1, 7) for band in ("1-2", "3-6", "7-12")]
WAVES = [f"{wave}_{order}q" for order in range(1, 7) for wave in ("cos", "sin")]
TWO_PLACES = [("joint 3", 0.8), ("joint 5", 0.2)]
CAMPAIGNS = {
    "adequate": verdict_document(ADEQUATE, sets=[({}, 0.97), ({"lost_motion": ["joint 3"]}, 0.02)]),
    "named": verdict_document(NAMED, [effect_entry()]),
    "named, location uncertain": verdict_document(NAMED, [effect_entry(locations=TWO_PLACES)]),
    "class": verdict_document(CLASS, [effect_entry(alternatives=["joint_tilt", "link_elasticity"])]),
    "class with a related mechanism": verdict_document(CLASS, [effect_entry(alternatives=["other"])]),
    "several": verdict_document(SEVERAL, [effect_entry(), effect_entry("payload", ["payload"], (), ["mass"])]),
    "named, not adopted": verdict_document(NAMED, [effect_entry(adopted=False)]),
    "class, not adopted": verdict_document(CLASS, [effect_entry(alternatives=["joint_tilt"], adopted=False)]),
    "unexplained": verdict_document(UNEXPLAINED, sets=[({"other": ["joint 2"]}, 0.9), ({}, 0.1)]),
    "not_testable": verdict_document(NOT_TESTABLE, sets=[({}, 1.0)]),
    "fault of the data": verdict_document(NAMED, [fault_entry()], ["the fit of the final model did not converge"]),
    "noise not known": verdict_document(ADEQUATE, noise="residual", warnings=["no repeats and no declared noise"]),
    "hundreds of parameters": verdict_document(SEVERAL, [effect_entry("transmission_harmonic", HARMONICS, range(1, 7), WAVES)]),
    "with a remainder": verdict_document(NAMED, [effect_entry()], outside=3, remainder=remainder_facts(outside=3)),
    "poses outside the range": verdict_document(NAMED, [effect_entry()], outside=3),
}


def facts_of(verdict, **changed):
    """Facts of the report of a verdict, with tables that fit it where none are given."""
    found = [effect["name"] for effect in verdict["effects"] if effect["adopted"]]
    given = {
        "steps": step_rows(effects=found),
        "experiment": [],
        "table": residual_table(),
        "descriptions": campaign_descriptions(),
        "parameters": parameter_table(),
    }
    return loop_facts(verdict, **given | changed)


def plainly(text):
    """A text with plain blanks where lines must not end."""
    return text.replace("\u00a0", " ")
