"""A command of this program beside the graph: one at a time, at a lower priority."""

import asyncio
import os
import signal
import sys
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from typing import Any

from endoscope_core.errors import EndoscopeError

_NICE = 10
_ENDED_S = 5.0


class BackgroundCommand:
    """Runs a command in a process group of its own, and ends that with all that it started."""

    def __init__(self) -> None:
        self._what = ''
        self._process: asyncio.subprocess.Process | None = None
        self._task: asyncio.Task[None] | None = None

    def require_free(self) -> None:
        """EndoscopeError while something is under way."""
        if self._task is not None and not self._task.done():
            raise EndoscopeError(self._what)

    def start(self, what: str, work: Coroutine[Any, Any, None]) -> None:
        """Begin work, which runs a command; `what` is why nothing else begins meanwhile."""
        self._what = what
        self._task = asyncio.get_running_loop().create_task(work)

    async def run(
        self,
        words: Sequence[str],
        line: Callable[[str], None],
        step: Callable[[str], None],
        *,
        answers: bool = False,
    ) -> int:
        """Run `endoscope`, lines of its output to `line`, of its errors to `step`; its status.

        With `answers`, `answer` writes to its input. On an exception there it is killed.
        """
        pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        process = self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, '-m', 'endoscope_bringup.cli', *words),
            stdin=pipe if answers else nothing,
            stdout=pipe,
            stderr=pipe,
            start_new_session=True,
        )
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)
        try:
            await asyncio.gather(_each(process.stdout, line), _each(process.stderr, step))
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise
        return await process.wait()

    def answer(self, line: str) -> None:
        """Write a line to the input of the command, unless it has ended."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.write(f'{line}\n'.encode())

    async def close(self) -> None:
        """End what is under way."""
        if self._task is None or self._task.done():
            return
        if self._process is not None and self._process.returncode is None:
            os.killpg(self._process.pid, signal.SIGTERM)
        _, late = await asyncio.wait({self._task}, timeout=_ENDED_S)
        if late and self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            await self._task


async def _each(lines: asyncio.StreamReader | None, take: Callable[[str], None]) -> None:
    assert lines is not None
    while line := await lines.readline():
        take(line.decode(errors='replace').rstrip('\n'))
