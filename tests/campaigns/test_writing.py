"""A written campaign is read back unchanged, and a campaign that cannot be written
leaves the folder as it was."""

import pyarrow as pa
import pytest
import yaml
from made_cells import assert_same
from support import refused

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal.campaigns.writing import (
    format_campaign_template,
    format_sheet_header,
    write_campaign,
)
from elastocal.io.documents import check_document, read_schema


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_campaign_is_read_back_and_a_faulty_one_does_not_replace_it(
    cell, tmp_path, kind
):
    campaign = cell.read()
    folder = tmp_path / "again"
    document = cell.document | {"robot": "planar"}
    write_campaign(folder, document, cell.table, 3, kind)
    read_back = read_campaign(read_campaign_folder(folder, cell.robots))
    assert_same(campaign.measurements, read_back.measurements)
    assert read_back.targets == campaign.targets
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert sorted(before) == ["campaign.yaml", f"measurements.{kind}"]
    with refused((folder / f"measurements.{kind}").as_posix(), "header", "'q4'"):
        write_campaign(folder, document, cell.table | {"q4": cell.table["q3"]}, 3, kind)
    with pytest.raises((ValueError, pa.ArrowException), match=r"argument|length"):
        write_campaign(
            folder, document, cell.table | {"q3": cell.table["q3"][1:]}, 3, kind
        )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_the_template_explains_every_key_and_its_commented_keys_are_valid(kuka):
    text = format_campaign_template("cell", kuka)
    keys = read_schema("campaign")["properties"]
    lines = text.splitlines()
    document = yaml.safe_load(text)
    check_document(document, "campaign", "template")
    assert set(keys) <= {line.removeprefix("# ").partition(":")[0] for line in lines}
    for number, line in enumerate(lines):
        if line.startswith("# ") and line[2:].partition(":")[0] in keys:
            assert lines[number - 1].startswith("# "), "explained above"
            check_document(document | yaml.safe_load(line[2:]), "campaign", line)
    assert (
        format_sheet_header(2)
        == "pose,load,repeat,target,q1,q2,fx,fy,fz,mx,my,mz,x,y,z\n"
    )
