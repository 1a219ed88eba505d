"""What each job read and wrote, when, and from which commit, configuration, seed and
environment: a record beside every output.

A record has the SHA-256 of its output and of all that the job read: whoever reads a
file next finds a byte that was altered, in it or in anything behind it. `python -m
elastocal.io.records | sha256sum --check` judges all files.
"""

import hashlib
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from elastocal.errors import InputError
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import Origin, configuration_sha256
from elastocal.io.texts import check_file

RECORDS = Path("results/records")
# What the pipeline makes, the rest is the user's.
_MADE = ("data", "results", "reports")
_AS_WRITTEN = "the file as the pipeline wrote it (delete {} and run the pipeline again)"
# Of one output, and of all else that its record says.
_FILES = "files"
_DIGEST = "sha256"


@dataclass(frozen=True)
class JobRecord:
    """One job that has ended well.

    `started`, `ended`: UTC, ISO 8601. `inputs`: digests of files by their names in the
    working directory, scripts and modules among them. `own`: inputs of the user, which
    no job made and which may lie elsewhere by now. `environment`: from
    `origin.environment`.
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
        """The rule and its wildcards."""
        return " ".join([self.rule, *self.wildcards.values()])

    @property
    def made_inputs(self) -> dict[str, str]:
        """Inputs that other jobs made."""
        return {
            file: digest
            for file, digest in self.inputs.items()
            if _made(file) and file not in self.own
        }

    @property
    def sources(self) -> dict[str, str]:
        """Inputs that come with the program or its configuration: modules, scripts,
        robots."""
        return {
            file: digest
            for file, digest in self.inputs.items()
            if not _made(file) and file not in self.own
        }


def write_records(job: JobRecord) -> None:
    """Keep the record of each output that lies where the pipeline makes files; a
    folder's has all of these."""
    for output in filter(_made, job.outputs):
        place = locate_record(output)
        place.parent.mkdir(parents=True, exist_ok=True)
        written = asdict(job) | {_FILES: _digests(output)}
        write_json(place, written | {_DIGEST: configuration_sha256(written)})


def read_record(path: str, within: str | Path = "") -> tuple[JobRecord, dict[str, str]]:
    """The job that made a file or folder, and the SHA-256 of each file that it wrote
    there.

    `within` is the folder that `path` and the records are in, here and below; the
    working directory without. An InputError refuses a missing record and one that is
    not as it was written.
    """
    place = locate_record(path, within)
    if not place.is_file():
        found = f"no record of the job that made it, {place}"
        raise InputError(Path(within, path), "", found, _AS_WRITTEN.format("it"))
    try:
        kept = read_json(place)
        if kept.pop(_DIGEST) != configuration_sha256(kept):
            raise ValueError("other contents than were written")
        files: dict[str, str] = kept.pop(_FILES)
        names = {key: tuple(kept[key]) for key in ("own", "outputs")}
        return JobRecord(**kept | names | {"origin": Origin(**kept["origin"])}), files
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            place,
            "",
            f"no record of a job ({error})",
            f"of {path} {_AS_WRITTEN.format('it')}",
        ) from None


def list_recorded_files(within: str | Path = "") -> dict[str, str]:
    """SHA-256 of every file that has a record, as `read_record`."""
    top = Path(within, RECORDS)
    names = sorted(
        place.relative_to(top).as_posix().removesuffix(".json")
        for place in top.rglob("*.json")
    )
    return {
        file: digest
        for name in names
        for file, digest in read_record(name, within)[1].items()
    }


def locate_record(path: str, within: str | Path = "") -> Path:
    """Where the record of a file or folder is."""
    return Path(within, RECORDS, f"{path}.json")


def digest_inputs(
    paths: Iterable[str], checked: Collection[str] | None = None
) -> tuple[dict[str, str], tuple[str, ...]]:
    """SHA-256 of what a job reads, and which of it is the user's own: what need not be
    checked and has no record.

    Of what is `checked`, all without, an InputError refuses a file in data, results or
    reports that has no record or is no longer what the job wrote that made it.
    """
    digests = {}
    own = []
    for path in map(str, paths):
        judged = checked is None or path in checked
        digests[path] = (
            _intact(path)[1] if judged and _made(path) else _joint(_digests(path))
        )
        if not judged and not locate_record(path).is_file():
            own.append(path)
    return digests, tuple(own)


def trace_jobs(targets: Iterable[str], within: str | Path = "") -> list[JobRecord]:
    """The jobs that made some files, and those that made what these read, to the first;
    in the order in which they began.

    An InputError refuses a missing record or file, and any file of these jobs that is
    not as it was written or not the one that the next job read.
    """
    found: dict[tuple[str, str], JobRecord] = {}
    digests: dict[str, str] = {}
    left = list(targets)
    while left:
        path = left.pop()
        if path not in digests:
            job, digests[path] = _intact(path, within)
            found[job.started, job.name] = job
            left += [*filter(_made, job.outputs), *job.made_inputs]
    for job in found.values():
        for path, digest in job.made_inputs.items():
            if digests[path] != digest:
                raise InputError(
                    Path(within, path),
                    "",
                    f"not what {job.name} read",
                    _AS_WRITTEN.format("it"),
                )
    return [job for _, job in sorted(found.items())]


def check_sources(jobs: Iterable[JobRecord], within: str | Path, allowed: str) -> None:
    """Refuse results that other modules, scripts or robots made than those that are
    here now: an InputError with `allowed`."""
    for job in jobs:
        for path, digest in (
            (Path(within, file), digest) for file, digest in job.sources.items()
        ):
            if not path.is_file() or compute_sha256(path) != digest:
                raise InputError(
                    path, "", f"not what {job.name} was made with", allowed
                )


def compute_sha256(path: str | Path) -> str:
    """SHA-256 of a file."""
    check_file(path)
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digests(path: str, within: str | Path = "") -> dict[str, str]:
    """SHA-256 of the file, or of all files below the folder but for hidden ones:
    Snakemake notes the time in one."""
    folder = Path(within, path)
    files = [
        file
        for file in folder.rglob("*")
        if file.is_file() and not file.name.startswith(".")
    ]
    names = (
        sorted(file.relative_to(within).as_posix() for file in files)
        if folder.is_dir()
        else [path]
    )
    return {name: compute_sha256(Path(within, name)) for name in names}


def _intact(path: str, within: str | Path = "") -> tuple[JobRecord, str]:
    """The job that made a file or folder, and what it holds, which is what the job
    wrote."""
    job, written = read_record(path, within)
    found = _digests(path, within) if Path(within, path).exists() else {}
    for file in sorted(written.keys() | found.keys()):
        if written.get(file) != found.get(file):
            what = "other contents than were written" if file in found else "nothing"
            raise InputError(
                Path(within, file),
                "",
                what,
                _AS_WRITTEN.format("it" if file == path else path),
            )
    return job, _joint(written)


def _joint(files: Mapping[str, str]) -> str:
    """Of a file its own SHA-256, of a folder that of its list."""
    return (
        next(iter(files.values()))
        if len(files) == 1
        else hashlib.sha256("".join(_lines(files)).encode()).hexdigest()
    )


def _lines(files: Mapping[str, str]) -> list[str]:
    """As `sha256sum` has them."""
    return [f"{digest}  {file}\n" for file, digest in files.items()]


def _made(path: str) -> bool:
    return (
        Path(path).parts[:1] in [(name,) for name in _MADE]
        and ".." not in Path(path).parts
    )


if __name__ == "__main__":
    try:
        sys.stdout.writelines(_lines(list_recorded_files()))
    except InputError as error:
        sys.exit(str(error))
