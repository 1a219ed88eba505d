"""Contents of a certificate, made up."""

from pathlib import Path

import yaml

from elastocal.application.accuracy import Accuracy


def made_document(decision="pass", misplaced=False, **conformity):
    document = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
    noise = "the tracker's noise is not in it"
    accuracy = Accuracy("base", "predicted", 1.2e-4, 3e-4, 1.6e-4, None, noise, 9, "some poses").document()
    sentences = [{"sentence": "reflector or tool sits 5.0 mm from where it is declared"}] if misplaced else []
    judged = document["conformity"] | {"decision": decision} | conformity
    return document | {"accuracy": accuracy, "misplaced": sentences, "conformity": judged}
