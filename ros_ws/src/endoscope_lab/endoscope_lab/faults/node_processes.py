"""The nodes as processes that can be killed, stalled and restarted."""

import json
import multiprocessing
import os
import signal
import sys
from collections.abc import Mapping
from pathlib import Path

from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes import program

NODES = (
    'motor_driver',
    'load_cells',
    'em_tracker',
    'supervisor',
    'compensator',
    'controller',
    'calibration',
    'master',
    'tip_force',
    'recorder',
)
GRAPH = 'graph'
_END_S = 10.0
# Forked from a process that has imported everything: a node restarts within a second, while the
# imports alone take four.
_FORK = multiprocessing.get_context('forkserver')


class NodeProcesses(ClosedOnExit):
    """Processes of nodes by name, ``graph`` for all in one; each logs to ``NAME.log``."""

    def __init__(self, domain: int, folder: Path) -> None:
        self._domain = domain
        self._folder = folder
        self._processes: dict[str, multiprocessing.process.BaseProcess] = {}
        _FORK.set_forkserver_preload(['endoscope_nodes.graph'])

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the running processes."""
        return tuple(self._processes)

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the running processes."""
        return tuple(map(self._pid, self._processes))

    def start(self, name: str, parameters: Mapping[str, Mapping[str, object]]) -> None:
        """Start a node, or all of them, with parameters by node; ValueError if it runs already."""
        if name in self._processes:
            raise ValueError(f'{name} runs already')
        file = self._folder / f'{name}.yaml'
        file.write_text(
            json.dumps({f'/**/{n}': {'ros__parameters': p} for n, p in parameters.items()}),
            encoding='utf-8',
        )
        words = ['--params-file', str(file)]
        log = self._folder / f'{name}.log'
        process = _FORK.Process(target=_run, args=(name, words, self._domain, str(log)))
        process.start()
        self._processes[name] = process

    def kill(self, name: str) -> None:
        """End a process with SIGKILL, without any shutdown."""
        process = self._processes.pop(name)
        process.kill()
        process.join(_END_S)

    def stall(self, name: str) -> None:
        os.kill(self._pid(name), signal.SIGSTOP)

    def resume(self, name: str) -> None:
        os.kill(self._pid(name), signal.SIGCONT)

    def end(self, name: str) -> None:
        """Ask a process to end, and wait for it."""
        process = self._processes.pop(name)
        process.terminate()
        process.join(_END_S)
        process.kill()
        process.join(_END_S)

    def _pid(self, name: str) -> int:
        pid = self._processes[name].pid
        if pid is None:
            raise RuntimeError(f'{name} has not been started')
        return pid

    def close(self) -> None:
        for process in self._processes.values():
            process.terminate()
        for name in self.running:
            self.end(name)


def _run(name: str, words: list[str], domain: int, log: str) -> None:
    with Path(log).open('ab', buffering=0) as sink:
        os.dup2(sink.fileno(), 1)
        os.dup2(sink.fileno(), 2)
    os.environ['ROS_DOMAIN_ID'] = str(domain)
    sys.argv = [name, '--ros-args', *words]
    started = program.graph if name == GRAPH else program.PROGRAMS[name]
    sys.exit(started.start())
