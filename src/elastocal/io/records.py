"""Record for each output what its job read and wrote, when, and from which commit,
configuration, seed and environment.

A record has the SHA-256 of the output and of everything that the job read, so that the
next reader notices an altered byte in the file or in any file that it was made from.
`python -m elastocal.io.records | sha256sum --check` checks all files.
"""

import hashlib
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import Origin, digest_configuration
from elastocal.io.texts import check_file

RECORDS = Path("results/records")
# Folders in which the pipeline makes files. All other files are the user's.
_PIPELINE_FOLDERS = ("data", "results", "reports")
# Keys of a record: digests of its output, and the digest of the record itself.
_FILES = "files"
_DIGEST = "sha256"


@dataclass(frozen=True)
class JobRecord:
    """One job that was successful.

    Attributes
    ----------
    rule, wildcards : the job.
    started, ended : UTC, ISO 8601.
    inputs : digests of files by their paths in the working directory, including scripts
        and modules.
    own : inputs of the user, which no job made and which may have moved since.
    outputs : paths of what the job made.
    origin : commit, configuration and seed.
    environment : as `origin.list_versions` returns it.
    """

    rule: str
    wildcards: Mapping[str, str]
    started: str
    ended: str
    inputs: Mapping[str, str]
    own: tuple[str, ...]
    outputs: tuple[str, ...]
    origin: Origin
    environment: Mapping[str, str]

    @property
    def name(self) -> str:
        """Rule and wildcards."""
        return " ".join([self.rule, *self.wildcards.values()])

    @property
    def made_inputs(self) -> dict[str, str]:
        """Inputs that other jobs made."""
        return self._select_inputs(made=True)

    @property
    def sources(self) -> dict[str, str]:
        """Inputs that come with the program or its configuration: modules, scripts,
        robots."""
        return self._select_inputs(made=False)

    def _select_inputs(self, *, made: bool) -> dict[str, str]:
        return {
            file: digest
            for file, digest in self.inputs.items()
            if _is_made(file) == made and file not in self.own
        }


def write_records(job: JobRecord) -> None:
    """Write the record of each output in the pipeline's folders; the record of an output
    folder has the digests of all files in it."""
    for output in filter(_is_made, job.outputs):
        path = locate_record(output)
        path.parent.mkdir(parents=True, exist_ok=True)
        record = asdict(job) | {_FILES: _digest_files(output)}
        write_json(path, record | {_DIGEST: digest_configuration(record)})


def read_record(path: str, within: str | Path = "") -> tuple[JobRecord, dict[str, str]]:
    """Read which job made a file or folder, and the SHA-256 of each file that it wrote
    there.

    Parameters
    ----------
    path : output of the job.
    within : folder that `path` and the records are relative to, in all functions of
        this module; the working directory if empty.

    Raises
    ------
    InputError
        If there is no record, or if it is not as it was written.
    """
    record_path = locate_record(path, within)
    if not record_path.is_file():
        finding = f"no record of the job that made it, {record_path}"
        raise _refusal(Path(within, path), finding)
    try:
        record = read_json(record_path)
        if record.pop(_DIGEST) != digest_configuration(record):
            raise ValueError("other contents than were written")
        files: dict[str, str] = record.pop(_FILES)
        record["own"] = tuple(record["own"])
        record["outputs"] = tuple(record["outputs"])
        record["origin"] = Origin(**record["origin"])
        return JobRecord(**record), files
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        finding = f"no record of a job ({error})"
        raise _refusal(record_path, finding, f"it and {path}") from None


def _refusal(path: Path, finding: str, outputs: str = "it") -> InputError:
    """Return the error of a file that is not as its job wrote it; `outputs` are what the
    user must delete so that they are made again."""
    allowed = f"the file as the pipeline wrote it (delete {outputs} and run the pipeline again)"
    return InputError(path, "", finding, allowed)


def list_recorded_outputs(within: str | Path = "") -> list[str]:
    """List the paths of every file and folder that has a record."""
    top = Path(within, RECORDS)
    return sorted(
        record.relative_to(top).as_posix().removesuffix(".json")
        for record in top.rglob("*.json")
    )


def list_recorded_files(within: str | Path = "") -> dict[str, str]:
    """Return the SHA-256 of every file that has a record or is in a folder that has one,
    by its path."""
    digests: dict[str, str] = {}
    for output in list_recorded_outputs(within):
        digests |= read_record(output, within)[1]
    return digests


def locate_record(path: str, within: str | Path = "") -> Path:
    """Return the path of the record of a file or folder."""
    return Path(within, RECORDS, f"{path}.json")


def digest_inputs(
    paths: Iterable[str], checked: Collection[str] | None = None
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the SHA-256 of the inputs of a job, and which inputs are the user's own:
    those that are not checked and have no record.

    Parameters
    ----------
    paths : inputs.
    checked : inputs to check; all if None.

    Raises
    ------
    InputError
        If a checked file in data, results or reports has no record, or is not as its
        job wrote it.
    """
    digests = {}
    users_inputs = []
    for path in map(str, paths):
        is_checked = checked is None or path in checked
        if is_checked and _is_made(path):
            digests[path] = _check_output(path)[1]
        else:
            digests[path] = _combine_digests(_digest_files(path))
        if not is_checked and not locate_record(path).is_file():
            users_inputs.append(path)
    return digests, tuple(users_inputs)


def trace_jobs(targets: Iterable[str], within: str | Path = "") -> list[JobRecord]:
    """Return the jobs that made some files, and all jobs behind them, in the order in
    which they began.

    An InputError refuses a missing record or file, and any file of these jobs that is
    not as it was written or not as the next job read it.
    """
    jobs: dict[tuple[str, str], JobRecord] = {}
    digests: dict[str, str] = {}
    pending = list(targets)
    while pending:
        path = pending.pop()
        if path not in digests:
            job, digests[path] = _check_output(path, within)
            jobs[job.started, job.name] = job
            pending += [*filter(_is_made, job.outputs), *job.made_inputs]
    for job in jobs.values():
        for path, digest in job.made_inputs.items():
            if digests[path] != digest:
                raise _refusal(
                    Path(within, path), f"other contents than {job.name} read"
                )
    return [job for _, job in sorted(jobs.items())]


def check_sources(jobs: Iterable[JobRecord], within: str | Path, allowed: str) -> None:
    """Refuse results that were made with other modules, scripts or robots than the
    present ones: an InputError with `allowed`."""
    for job in jobs:
        for file, digest in job.sources.items():
            path = Path(within, file)
            if not path.is_file() or compute_sha256(path) != digest:
                finding = f"another version than {job.name} was made with"
                raise InputError(path, "", finding, allowed)


def compute_sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file."""
    check_file(path)
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def refuse_other_contents(path: str | Path, sha256: str, allowed: str) -> None:
    """Refuse a file with another SHA-256 than the stated one: an InputError with
    `allowed`."""
    digest = compute_sha256(path)
    if digest != sha256:
        raise InputError(path, "", f"SHA-256 {digest}", allowed)


def _digest_files(path: str, within: str | Path = "") -> dict[str, str]:
    """Return the SHA-256 of a file, or of all files below a folder. Hidden files are
    left out, because Snakemake writes the time to one."""
    names = [path]
    folder = Path(within, path)
    if folder.is_dir():
        names = sorted(
            file.relative_to(within).as_posix()
            for file in folder.rglob("*")
            if file.is_file() and not file.name.startswith(".")
        )
    return {name: compute_sha256(Path(within, name)) for name in names}


def _check_output(path: str, within: str | Path = "") -> tuple[JobRecord, str]:
    """Return the job that made a file or folder, and the digest; refuse a file that is
    not as the job wrote it."""
    job, written = read_record(path, within)
    present = _digest_files(path, within) if Path(within, path).exists() else {}
    for file in sorted(written.keys() | present.keys()):
        if written.get(file) != present.get(file):
            finding = "nothing"
            if file in present:
                finding = "other contents than were written"
            output = "it" if file == path else path
            raise _refusal(Path(within, file), finding, output)
    return job, _combine_digests(written)


def _combine_digests(files: Mapping[str, str]) -> str:
    """Return the SHA-256 of a single file, or that of the list of several files."""
    if len(files) == 1:
        return next(iter(files.values()))
    return hashlib.sha256("".join(_format_list(files)).encode()).hexdigest()


def _format_list(files: Mapping[str, str]) -> list[str]:
    """Return lines as `sha256sum` prints them."""
    return [f"{digest}  {file}\n" for file, digest in files.items()]


def _is_made(path: str) -> bool:
    """Return whether the pipeline makes the file."""
    folders = Path(path).parts
    return folders[:1] in [(name,) for name in _PIPELINE_FOLDERS] and (
        ".." not in folders
    )


if __name__ == "__main__":
    try:
        sys.stdout.writelines(_format_list(list_recorded_files()))
    except InputError as error:
        sys.exit(str(error))
