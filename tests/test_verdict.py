"""Each kind of verdict survives verdict.json, and a file of another form is refused."""

import json
from dataclasses import replace

import jsonschema
import pytest
from made_loop_tables import CAMPAIGNS

from elastocal.errors import InputError
from elastocal.io.json_files import read_json, write_json
from elastocal.verdict import (
    NextExperiment,
    build_verdict_schema,
    read_verdict,
    write_verdict,
)


@pytest.mark.parametrize("kind", CAMPAIGNS)
def test_a_verdict_survives_its_file_and_fits_the_schema(kind, tmp_path):
    path = tmp_path / "verdict.json"
    write_verdict(path, CAMPAIGNS[kind])
    assert read_verdict(path) == CAMPAIGNS[kind]
    document = json.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(document, build_verdict_schema())
    assert "next_experiment" not in document


def test_a_proposed_experiment_is_part_of_the_file(tmp_path):
    proposal = NextExperiment(
        0, "nothing is ambiguous", ("payload",), (), (), None, None
    )
    verdict = replace(CAMPAIGNS["named"], next_experiment=proposal)
    write_verdict(tmp_path / "verdict.json", verdict)
    assert read_verdict(tmp_path / "verdict.json").next_experiment == proposal


def test_a_verdict_has_missing_effects_or_faults():
    faulty = CAMPAIGNS["fault of the data"]
    named = CAMPAIGNS["named"]
    assert faulty.faults == faulty.effects and not faulty.missing_effects
    assert named.missing_effects == named.effects and not named.faults


def test_a_file_of_another_form_is_refused(tmp_path):
    path = tmp_path / "verdict.json"
    write_verdict(path, CAMPAIGNS["named"])
    write_json(path, read_json(path) | {"kept": 1})
    with pytest.raises(InputError, match="kept"):
        read_verdict(path)
