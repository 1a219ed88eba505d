"""The whole loop in one call, as blind cases are diagnosed: it says what was planted and opens nothing that is sealed."""

import json
import subprocess
import sys

from made_folders import made_folder

from elastocal.loop.whole import diagnosed

WATCHED = """
import sys
opened = []
sys.addaudithook(lambda event, details: opened.append(str(details[0])) if event == "open" else None)
from elastocal.loop.whole import diagnosed
diagnosed(*sys.argv[1:3], 200, 1)
print("\\n".join(opened))
"""


def test_planted_offset_is_named(kuka, config_folder, tmp_path):
    from made_folders import made_table

    table = made_table(kuka, "made", offset_of_joint_3=3e-3)
    folder = made_folder(tmp_path / "campaign", kuka, table=table)
    verdict = diagnosed(folder.as_posix(), (config_folder / "robots").as_posix(), 400, 1)
    json.dumps(verdict, allow_nan=False)
    assert verdict["effects"][0]["joints"] == [3] and verdict["verdict"] in ("named", "class")
    assert verdict["heldout"]["after"]["rms_m"] < verdict["heldout"]["before"]["rms_m"]


def test_diagnosing_process_opens_no_sealed_file(kuka, config_folder, tmp_path):
    folder = made_folder(tmp_path / "blind" / "case_1", kuka, name="case_1")
    sealed = tmp_path / "sealed" / "case_1.json"
    sealed.parent.mkdir()
    sealed.write_text("{}", encoding="utf-8")
    robots = (config_folder / "robots").as_posix()
    done = subprocess.run([sys.executable, "-c", WATCHED, folder.as_posix(), robots], capture_output=True, text=True)
    assert not done.returncode, done.stderr
    opened = done.stdout.splitlines()
    assert any(path.endswith("campaign.yaml") for path in opened)
    assert not [path for path in opened if "sealed" in path]
