"""Campaigns written to a folder: they are those read, and one that cannot be written
leaves what was there."""

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
def test_written_campaign_is_the_one_read_and_one_that_cannot_be_written_leaves_it(
    cell, tmp_path, kind
):
    first = cell.read()
    folder = tmp_path / "again"
    document = cell.document | {"robot": "planar"}
    write_campaign(folder, document, cell.table, 3, kind)
    second = read_campaign(read_campaign_folder(folder, cell.robots))
    assert_same(first.measurements, second.measurements)
    assert second.targets == first.targets
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert sorted(before) == ["campaign.yaml", f"measurements.{kind}"]
    with refused((folder / f"measurements.{kind}").as_posix(), "header", "'q4'"):
        write_campaign(folder, document, cell.table | {"q4": cell.table["q3"]}, 3, kind)
    with pytest.raises((ValueError, pa.ArrowException), match=r"argument|length"):
        write_campaign(
            folder, document, cell.table | {"q3": cell.table["q3"][1:]}, 3, kind
        )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_every_key_is_explained_and_those_left_out_are_valid_once_uncommented(kuka):
    text = format_campaign_template("cell", kuka)
    known = read_schema("campaign")["properties"]
    lines = text.splitlines()
    shown = yaml.safe_load(text)
    check_document(shown, "campaign", "template")
    assert set(known) <= {line.removeprefix("# ").partition(":")[0] for line in lines}
    for number, line in enumerate(lines):
        if line.startswith("# ") and line[2:].partition(":")[0] in known:
            assert lines[number - 1].startswith("# "), "explained above"
            check_document(shown | yaml.safe_load(line[2:]), "campaign", line)
    assert (
        format_sheet_header(2)
        == "pose,load,repeat,target,q1,q2,fx,fy,fz,mx,my,mz,x,y,z\n"
    )
