"""What each job read and wrote, when, and from which commit, configuration and seed: a JSON file for each of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import Origin, configuration_sha256

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

RECORDS = Path("results/jobs")
_LOGS = "results/logs"
# Of all else that the record says.
_DIGEST = "sha256"


@dataclass(frozen=True)
class JobRecord:
    """One job that has ended well.

    Attributes
    ----------
    rule : str
    wildcards : dict of str to str
    started, ended : str
        UTC, ISO 8601.
    inputs, outputs : tuple of str
        Files by their names in the working directory; scripts and modules are among the inputs.
    origin : Origin
    """

    rule: str
    wildcards: Mapping[str, str]
    started: str
    ended: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    origin: Origin

    @property
    def name(self) -> str:
        """The rule and its wildcards."""
        return " ".join([self.rule, *self.wildcards.values()])


def write_job_record(log: str, record: JobRecord) -> None:
    """Keep the record of a job; it appears whole or not at all.

    Parameters
    ----------
    log : str
        The job's log in results/logs, after which the record is named; of a log elsewhere no record is kept.
    record : JobRecord
    """
    if not Path(log).is_relative_to(_LOGS):
        return
    place = (RECORDS / Path(log).relative_to(_LOGS)).with_suffix(".json")
    place.parent.mkdir(parents=True, exist_ok=True)
    written = asdict(record)
    write_json(place, written | {_DIGEST: _digest(written)})


def read_job_records(folder: str | Path = RECORDS) -> list[JobRecord]:
    """All records.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    list of JobRecord
        In the order of their names.

    Raises
    ------
    InputError
        A file that is no record.
    """
    return [_read(path) for path in sorted(Path(folder).rglob("*.json"))]


def jobs_behind(targets: Iterable[str], records: Iterable[JobRecord]) -> list[JobRecord]:
    """The jobs that made some files, and those that made what these read, to the first.

    Parameters
    ----------
    targets : iterable of str
    records : iterable of JobRecord

    Returns
    -------
    list of JobRecord
        In the order in which they began.

    Raises
    ------
    InputError
        No record says what made one of the files.
    """
    maker = {file: record for record in records for file in record.outputs}
    found: dict[str, JobRecord] = {}
    left = list(targets)
    for file in left:
        if file not in maker:
            allowed = "a file of which a job of this version left a record (delete it and it is made again)"
            raise InputError(file, "", f"no record in {RECORDS} of the job that made it", allowed)
    while left:
        record = maker.get(left.pop())
        if record is not None and record.name not in found:
            found[record.name] = record
            left += record.inputs
    return sorted(found.values(), key=lambda record: (record.started, record.name))


def _digest(written: Mapping[str, Any]) -> str:
    return configuration_sha256(written)


def _read(path: Path) -> JobRecord:
    try:
        kept = read_json(path)
        if kept.pop(_DIGEST) != _digest(kept):
            raise ValueError("other contents than were written")
        files = {key: tuple(kept[key]) for key in ("inputs", "outputs")}
        return JobRecord(**kept | files | {"origin": Origin(**kept["origin"])})
    except (ValueError, KeyError, TypeError) as error:
        allowed = "the file as the pipeline wrote it (delete what the job made and it is made again)"
        raise InputError(path, "", f"no record of a job ({error})", allowed) from None
