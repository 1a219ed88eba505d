"""Synthetic contents of a certificate."""

from dataclasses import asdict
from pathlib import Path

import yaml

from elastocal.verdict import Accuracy


def make_document(decision="pass", *, misplaced=False, **conformity):
    """Make the document of a certificate with some entries of its conformity."""
    document = yaml.safe_load(
        Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
    )
    sentences = []
    if misplaced:
        sentence = "reflector or tool sits 5.0 mm from where it is declared"
        sentences.append({"sentence": sentence})
    judged = document["conformity"] | {"decision": decision} | conformity
    return document | {
        "accuracy": asdict(
            Accuracy("base", 1.2e-4, 3e-4, 1.6e-4, None, 9, "some poses")
        ),
        "misplaced": sentences,
        "conformity": judged,
    }
