"""Campaigns written to a folder: they are those read, and one that cannot be written leaves what was there."""

import pyarrow as pa
import pytest
from made_cells import assert_same
from support import refused

from elastocal.campaigns.reading import read_campaign
from elastocal.campaigns.writing import write_campaign


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_written_campaign_is_the_one_read(cell, tmp_path, kind):
    first = cell.read()
    document = cell.document | {"robot": "planar"}
    write_campaign(tmp_path / "again", document, cell.table, 3, kind)
    second = read_campaign(tmp_path / "again", cell.robots)
    assert_same(first.measurements, second.measurements)
    assert second.targets == first.targets
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["campaign.yaml", f"measurements.{kind}"]


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_campaign_that_cannot_be_written_leaves_the_one_before_it(cell, tmp_path, kind):
    folder, document = tmp_path / "again", cell.document | {"robot": "planar"}
    cell.write()
    write_campaign(folder, document, cell.table, 3, kind)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with refused((folder / f"measurements.{kind}").as_posix(), "header", "'q4'"):
        write_campaign(folder, document, cell.table | {"q4": cell.table["q3"]}, 3, kind)
    with pytest.raises((ValueError, pa.ArrowException), match=r"argument|length"):
        write_campaign(folder, document, cell.table | {"q3": cell.table["q3"][1:]}, 3, kind)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
