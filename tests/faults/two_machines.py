"""Two machines made of network namespaces, with a link between them and folders that only one of them sees."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from relnav_process import heed_interrupts, members

HIDING = 'hostname "$1"; for folder in $2; do mount -t tmpfs none "$folder"; done; shift 2; exec "$@"'


class Machine:
    """A network namespace with a name and an address of its own.

    Args:
        name: Its name.
        address: Its address.
    """

    def __init__(self, name: str, address: str) -> None:
        self.name, self.address = name, address
        self.namespace = f"{name}-{os.getpid()}"
        self.device = f"v{name[-1]}{os.getpid()}"
        self.started: list[subprocess.Popen[str]] = []

    def start(self, command: list[str], cwd: Path, hides: Path | None = None) -> subprocess.Popen[str]:
        """Start a command here; what lies in the folder that it hides, it does not see."""
        process = subprocess.Popen(
            [
                *["ip", "netns", "exec", self.namespace, "unshare", "--uts", "--mount"],
                *["sh", "-c", HIDING, "sh", self.name, "" if hides is None else str(hides), *command],
            ],
            cwd=cwd,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE if hides is None else subprocess.DEVNULL,
            text=True,
            start_new_session=True,
            preexec_fn=heed_interrupts,
        )
        self.started.append(process)
        return process

    def link(self, state: str) -> None:
        """Put the link of this machine up or down."""
        _must("ip", "netns", "exec", self.namespace, "ip", "link", "set", self.device, state)

    def send(self, process: subprocess.Popen[str], number: int) -> None:
        """Send a signal to a process and all that it has started."""
        for pid in [*members(process.pid), process.pid]:
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                continue

    def end(self) -> None:
        for process in self.started:
            self.send(process, signal.SIGKILL)
            process.communicate()
        subprocess.run(["ip", "netns", "del", self.namespace], stderr=subprocess.DEVNULL, check=False)


def two_machines() -> tuple[Machine, Machine]:
    """Return two machines with a link between them; a test that may not make them is skipped."""
    if os.name != "posix" or os.geteuid() != 0 or not all(map(shutil.which, ("ip", "unshare", "mount"))):
        pytest.skip("two machines need network namespaces: root, and the commands ip, unshare and mount")
    found = Machine("machine-a", "10.77.0.1"), Machine("machine-b", "10.77.0.2")
    a, b = found
    try:
        for machine in found:
            _must("ip", "netns", "add", machine.namespace)
        peer = ["peer", "name", b.device, "netns", b.namespace]
        _must("ip", "link", "add", a.device, "netns", a.namespace, "type", "veth", *peer)
        for machine in found:
            inside = ["ip", "netns", "exec", machine.namespace, "ip"]
            _must(*inside, "addr", "add", f"{machine.address}/24", "dev", machine.device)
            _must(*inside, "link", "set", "lo", "up")
            machine.link("up")
    except subprocess.CalledProcessError as error:
        for machine in found:
            machine.end()
        pytest.skip(f"two machines need network namespaces: {error.stderr.strip()}")
    return found


def _must(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)
