"""A folder to begin with explains every key, and is read as it stands."""

import pytest
import yaml

from elastocal.campaigns.template import campaign_template, robot_template, sheet_template
from elastocal.io.documents import check_document, read_schema
from elastocal.mechanics.robot_file import robot_from_document


def arm():
    return robot_from_document(yaml.safe_load(robot_template()), "robot.yaml")


@pytest.mark.parametrize(("schema", "text"), [("robot", robot_template()), ("campaign", campaign_template("cell", arm()))])
def test_every_key_is_explained_and_those_left_out_are_valid_once_uncommented(schema, text):
    check_document(yaml.safe_load(text), schema, "template")
    keys = {f"{line.removeprefix('# ').partition(':')[0]}" for line in text.splitlines() if ":" in line}
    assert set(read_schema(schema)["properties"]) <= keys
    optional = [
        line
        for line in text.splitlines()
        if line.startswith("# ") and line[2:].partition(":")[0] in read_schema(schema)["properties"]
    ]
    for line in optional:
        assert text.splitlines()[text.splitlines().index(line) - 1].startswith("# "), "explained above"
        check_document(yaml.safe_load(text) | yaml.safe_load(line[2:]), schema, line)


def test_the_sheet_has_the_columns_that_every_campaign_needs():
    assert sheet_template(2) == "pose,load,repeat,target,q1,q2,fx,fy,fz,mx,my,mz,x,y,z\n"
