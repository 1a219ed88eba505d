"""The process of the command: threads, the terminal, and interrupts."""

import os
import signal
import subprocess
import sys
import time

import pytest
from support import heed_interrupts

from elastocal.__main__ import _THREAD_VARIABLES

COMMAND = [sys.executable, "-m", "elastocal"]


def run_command(*arguments, **environment):
    return subprocess.run(
        [*COMMAND, *arguments],
        env=os.environ | environment,
        capture_output=True,
        check=False,
    )


def test_a_terminal_that_lacks_a_character_gets_a_question_mark(tmp_path):
    """The refusal quotes a name that ASCII cannot write."""
    finished = run_command("check", f"{tmp_path}/Zelle-ä", PYTHONIOENCODING="ascii")
    assert finished.returncode == 1
    assert b"Zelle-?" in finished.stderr and b"Traceback" not in finished.stderr


@pytest.mark.parametrize("delay_s", [0.0, 0.15, 0.4, 1.0])
def test_an_interrupt_ends_without_a_traceback(tmp_path, delay_s):
    """During the imports, which take most of the first second, and after them. The delay
    counts from the first import behind the handler: before it Python itself starts, for
    as long as the load of the machine makes it."""
    with subprocess.Popen(
        [sys.executable, "-X", "importtime", *COMMAND[1:], "demo"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        bufsize=0,
        preexec_fn=heed_interrupts,
    ) as process:
        while not process.stderr.readline().rstrip().endswith(b" elastocal.command"):
            assert process.poll() is None
        time.sleep(delay_s)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    # Python dies of the signal itself, which a shell calls 130 too, if the interrupt has
    # passed a call of `exec`, such as those of data classes during imports.
    assert process.returncode in (130, -signal.SIGINT)
    assert b"Traceback" not in output + errors


_MISLED_LIBRARY = """
import os, signal, sys, types
import elastocal.__main__ as entry

def fail():
    try:
        os.kill(os.getpid(), signal.SIGINT)
        signal.pause()
    except KeyboardInterrupt:
        sys.exit("Python: found initialization failed")

module = types.ModuleType("elastocal.command.main")
module.main = fail
sys.modules["elastocal.command.main"] = module
entry.main()
"""


def test_an_interrupt_that_a_library_takes_for_a_fault_is_an_interrupt():
    """Modules in C turn one during their import into an ImportError."""
    finished = subprocess.run(
        [sys.executable, "-c", _MISLED_LIBRARY],
        capture_output=True,
        check=False,
        timeout=60,
        preexec_fn=heed_interrupts,
    )
    assert finished.returncode == 130
    assert finished.stderr == b""


@pytest.mark.parametrize(("stated", "expected"), [(None, "1"), ("2", "2")])
def test_numerical_libraries_have_one_thread_unless_the_user_says_otherwise(
    stated, expected
):
    script = (
        "import os, elastocal.__main__ as entry;"
        "entry.prepare_process();"
        f"print(*[os.environ[name] for name in {_THREAD_VARIABLES!r}])"
    )
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in _THREAD_VARIABLES
    }
    if stated:
        environment |= dict.fromkeys(_THREAD_VARIABLES, stated)
    printed = subprocess.check_output(
        [sys.executable, "-c", script], env=environment, text=True
    )
    assert set(printed.split()) == {expected}
