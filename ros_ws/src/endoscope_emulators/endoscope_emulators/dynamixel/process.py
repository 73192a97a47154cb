"""An emulated bus in a process of its own, so that its delays do not wait for the driver's."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from endoscope_core.exit_status import ClosedOnExit


class EmulatorProcess(ClosedOnExit):
    """An emulated bus in a process: servos at `baud` bit/s with springs in N m/rad on shafts."""

    def __init__(
        self,
        ids: Sequence[int] = (1, 2),
        baud: int = 1_000_000,
        link: Path | None = None,
        stiffness: float = 0.2,
    ) -> None:
        command = [sys.executable, '-m', 'endoscope_emulators.dynamixel']
        command += ['--ids', *map(str, ids), '--baud', str(baud), '--stiffness', str(stiffness)]
        command += [] if link is None else ['--link', str(link)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.port = self._read()  # device file for the client
        if not self.port:
            raise RuntimeError('the emulator does not start')

    def do(self, action: str, *arguments: float) -> Any:
        """Carry out an action of the emulator; see its module."""
        if self._process.stdin is None:
            raise RuntimeError('the emulator has no input')
        self._process.stdin.write(json.dumps([action, *arguments]) + '\n')
        self._process.stdin.flush()
        return json.loads(self._read())

    def state(self, device: int) -> dict[str, float]:
        """Registers, position and goal (rad) of a servo."""
        states: dict[str, dict[str, float]] = self.do('state')
        return states[str(device)]

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _read(self) -> str:
        return '' if self._process.stdout is None else self._process.stdout.readline().strip()
