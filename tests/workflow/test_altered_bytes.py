"""Of each file that a run makes in data/ and results/, any byte that is altered is found by what reads the file next."""

import random

from elastocal.errors import InputError
from elastocal.io.records import RECORDS, input_digests, read_record

# Texts for people: of what a job said and how long it took no job makes anything.
NOT_READ = ("results/logs/", "results/timings/")


def altered_bytes(folder, flips, seed):
    """Alter bytes of every file, one at a time; the numbers of those that were found, that say the same, and that were missed.

    `folder`: of a finished run; the working directory. `flips`: for each file, at random places. Returns files and places of
    those that were missed.
    """
    draws, counts, missed = random.Random(seed), {"found": 0, "harmless": 0, "missed": 0}, []
    paths = [path for top in ("data", "results") for path in sorted((folder / top).rglob("*")) if path.is_file()]
    names = [path.relative_to(folder).as_posix() for path in paths]
    for name in (name for name in names if not name.startswith(NOT_READ) and name.count("/") > 1):
        path = folder / name
        written = path.read_bytes()
        output = (
            name.removeprefix(f"{RECORDS.as_posix()}/").removesuffix(".json") if path.is_relative_to(folder / RECORDS) else name
        )
        meant = read_record(output)
        for _ in range(flips):
            place, bit = draws.randrange(len(written)), 1 << draws.randrange(8)
            path.write_bytes(written[:place] + bytes([written[place] ^ bit]) + written[place + 1 :])
            try:
                input_digests([output])
                same = output != name and meant == read_record(output)
                counts["harmless" if same else "missed"] += 1
                missed += [] if same else [f"{name} at {place}"]
            except InputError:
                counts["found"] += 1
        path.write_bytes(written)
    return counts, missed


def test_any_altered_byte_is_found(finished_paper, monkeypatch):
    monkeypatch.chdir(finished_paper.folder)
    counts, missed = altered_bytes(finished_paper.folder, 1, 5)
    assert missed == []
    # Of a record a blank is harmless; of any other file every byte counts.
    assert counts["found"] > 50 and counts["harmless"] < counts["found"] / 10
