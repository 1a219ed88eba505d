"""What is stated of claims and questions, of made-up tables."""

import json

from made_study_tables import TITLES, question_facts


def test_facts_can_be_written_as_json():
    assert json.loads(json.dumps(question_facts(), allow_nan=False)) == question_facts()


def test_studies_are_stated_of_each_robot_by_its_title():
    assert [stated["title"] for stated in question_facts()["over_studies"]] == [*TITLES.values()]
