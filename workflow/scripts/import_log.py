"""Until a script has imported what it needs, and `job.run` sees to its log, what ends
it is written there; imported first."""

import sys
import traceback
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from elastocal.errors import InputError, describe_system_fault
from elastocal.io.atomic_writes import write_text


def write_log(log: str | Path, text: str) -> None:
    """Write a log; the terminal has the text too, so a log that cannot be written is no
    fault of its own."""
    with suppress(OSError, InputError):
        write_text(log, text)


def _log_and_say(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    # Snakemake puts it into the script itself.
    job = getattr(sys.modules["__main__"], "snakemake", None)
    if job is not None:
        text = "".join(traceback.format_exception(kind, error, trace))
        fault = (
            describe_system_fault(error)
            if isinstance(error, MemoryError | ImportError)
            else None
        )
        write_log(
            job.log[0],
            f"{text}{fault}\n" if fault and fault.source == "memory" else text,
        )
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _log_and_say
