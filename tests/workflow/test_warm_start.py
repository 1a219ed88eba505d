"""Jobs start as copies of one process that has the libraries, and report how they end."""

import errno
import os
import signal
import socket
import subprocess
import sys
import time

import psutil
import pytest
import warm_start

REFUSALS = [errno.EPERM, errno.ENOSYS, errno.EAGAIN]


@pytest.fixture
def exit_handlers(monkeypatch):
    """Handlers that the server registers for the end of the run; called at the end."""
    handlers = []
    monkeypatch.setattr(warm_start.atexit, "register", handlers.append)
    yield handlers
    for handler in reversed(handlers):
        handler()


def refuse(error_number):
    def refused(*arguments, **settings):
        raise OSError(error_number, os.strerror(error_number))

    return refused


@pytest.mark.parametrize(
    ("last_line", "exit_code"),
    [
        ("pass", 0),
        ("os.kill(os.getpid(), 15)", -15),
        ("os.kill(os.getppid(), 9)", -9),
    ],
    ids=["ends well", "is killed", "kills the server"],
)
def test_a_script_is_a_process_of_its_own_whose_exit_code_is_reported(
    last_line, exit_code, tmp_path, exit_handlers
):
    start_script = warm_start.start_server()
    report = tmp_path / "report"
    script = tmp_path / "script.py"
    script.write_text(
        "import os, time\n"
        # The server reports the process before the script ends.
        "time.sleep(0.1)\n"
        f"with open({str(report)!r}, 'w') as file:\n"
        "    file.write(f'{os.getpid()} {os.getppid()} {__name__}')\n"
        f"{last_line}\n"
    )
    started = start_script(str(script))
    assert started.wait() == exit_code
    process, parent, name = report.read_text().split()
    assert (int(process), name) == (started.process, "__main__")
    assert psutil.Process(int(parent)).ppid() == os.getpid()


def test_after_the_server_was_killed_the_next_script_is_refused(
    tmp_path, exit_handlers
):
    start_script = warm_start.start_server()
    script = tmp_path / "script.py"
    script.write_text("import os\nos.kill(os.getppid(), 9)\n")
    assert start_script(str(script)).wait() == -signal.SIGKILL
    with pytest.raises(OSError):
        # A request that meets the dying server has no answer, and counts as killed.
        for _ in range(100):
            assert start_script(str(script)).wait() == -signal.SIGKILL
            time.sleep(0.01)


@pytest.mark.parametrize("error_number", REFUSALS, ids=errno.errorcode.get)
def test_no_server_starts_if_the_system_refuses_to_watch_a_process(
    error_number, monkeypatch
):
    monkeypatch.setattr(os, "pidfd_open", refuse(error_number))
    assert warm_start.start_server() is None


def test_no_server_starts_on_a_system_that_cannot_watch_processes(monkeypatch):
    monkeypatch.delattr(os, "pidfd_open")
    assert warm_start.start_server() is None


@pytest.mark.parametrize("error_number", REFUSALS, ids=errno.errorcode.get)
def test_no_server_starts_if_the_system_refuses_its_process(error_number, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", refuse(error_number))
    assert warm_start.start_server() is None


SERVER_WITHOUT_FORK = f"""
import errno, os, socket, sys
sys.path.insert(0, {os.path.dirname(warm_start.__file__)!r})
import warm_start

def refuse():
    raise OSError(int(sys.argv[2]), "refused")

os.fork = refuse
warm_start.LIBRARIES.clear()
warm_start.serve(socket.socket(fileno=int(sys.argv[1])))
"""


@pytest.mark.parametrize("error_number", REFUSALS, ids=errno.errorcode.get)
def test_a_script_is_refused_if_the_system_refuses_the_server_a_process(
    error_number, monkeypatch, exit_handlers
):
    start_process = subprocess.Popen

    def start_server_without_fork(command, **settings):
        number = command[-1]
        return start_process(
            [sys.executable, "-c", SERVER_WITHOUT_FORK, number, str(error_number)],
            **settings,
        )

    monkeypatch.setattr(subprocess, "Popen", start_server_without_fork)
    start_script = warm_start.start_server()
    with pytest.raises(ChildProcessError):
        start_script("script.py")


def test_a_request_is_one_message_with_its_pipe():
    """The server relies on it: a request must not arrive in pieces."""
    first, second = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with first, second:
        socket.send_fds(first, [b"one"], [0])
        socket.send_fds(first, [b"two"], [0])
        message, descriptors, *_ = socket.recv_fds(second, 4096, 1)
        assert (message, len(descriptors)) == (b"one", 1)
        os.close(descriptors[0])
