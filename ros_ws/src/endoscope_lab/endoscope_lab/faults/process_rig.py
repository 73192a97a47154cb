"""The running graph as processes with an operator: enabled, moved, faulted, enabled again."""

import time
from pathlib import Path
from random import Random

from endoscope_core.exit_status import ClosedOnExit
from endoscope_core.rig import load_rig
from endoscope_lab.faults.node_processes import GRAPH, NODES, NodeProcesses
from endoscope_lab.faults.operator import Operator
from endoscope_nodes.runtime.private_domain import private_domain

PROCESS_PATIENCE_S = 60.0
_MOVED_RAD = 0.02


class ProcessRig(ClosedOnExit):
    """The nodes in processes of their own, or all in one.

    `rate`: ticks per second.
    `composed`: whether all nodes run in one process.
    `folder`: for bags and logs.
    `random`: source of all random draws.
    """

    def __init__(self, rate: int, composed: bool, folder: Path, random: Random) -> None:
        self.rate = rate
        self.random = random
        self.facts = load_rig()
        self.names = (GRAPH,) if composed else NODES
        self.bag = folder / 'bag'
        self._folder = folder
        self._bags = 0
        self._source = 'master'
        domain = private_domain()
        self.processes = NodeProcesses(domain, folder)
        self.operator = Operator(domain)
        self.begin('master')

    def begin(self, source: str) -> None:
        """Run the graph with a source of motion; see `ProcessFault`."""
        of_master = {'outside': 'none'}.get(source, source)
        holder = GRAPH if GRAPH in self.names else 'master'
        if of_master != self._source or source == 'motion':
            if holder in self.processes.running:
                self.end(holder)
            self._source = of_master
        changes_hands = self.operator.use('none' if source == 'motion' else source)
        self.operator.press(not changes_hands)
        self.revive()
        if changes_hands:
            self.operator.let_go_and_press()

    def revive(self) -> None:
        """Start the processes that do not run, and wait until every node publishes."""
        for name in self.names:
            if name not in self.processes.running:
                self.start(name)
        if not self.operator.serve(PROCESS_PATIENCE_S, self._all_heard):
            silent = sorted(set(NODES) - set(self.operator.graph.heard_ns))
            raise RuntimeError(f'silent nodes: {", ".join(silent)}')

    def _all_heard(self) -> bool:
        return set(self.operator.graph.heard_ns) >= set(NODES)

    def start(self, name: str) -> None:
        first = 'motor_driver' if name == GRAPH else name
        # Faults are timed by the computer's clock, which a simulated one falls behind.
        of_first: dict[str, object] = {'tick_rate': self.rate, 'use_sim_time': False}
        parameters: dict[str, dict[str, object]] = {first: of_first}
        if name in ('master', GRAPH):
            parameters.setdefault('master', {})['source'] = self._source
        if name in ('controller', GRAPH):
            # Corrections of feedback would hide those of a fault.
            parameters.setdefault('controller', {})['active'] = False
        if name in ('recorder', GRAPH):
            self._bags += 1
            self.bag = self._folder / f'bag-{self._bags}'
            parameters.setdefault('recorder', {})['bag'] = str(self.bag)
        self._forget(name)
        self.processes.start(name, parameters)

    def kill(self, name: str) -> None:
        self.processes.kill(name)
        self._forget(name)

    def kill_all(self) -> None:
        """Kill all processes, so that the next :meth:`begin` starts them again."""
        for name in self.processes.running:
            self.kill(name)

    def end(self, name: str) -> None:
        self.processes.end(name)
        self.operator.serve(0.2)
        self._forget(name)

    def _forget(self, name: str) -> None:
        for node in NODES if name == GRAPH else (name,):
            self.operator.graph.heard_ns.pop(node, None)

    def enable_and_move(self) -> float | None:
        """Enable until the shafts move; time in s that it took, None if they do not."""
        operator = self.operator
        began = time.monotonic()
        rest = operator.shafts[-1].position if operator.shafts else (0.0, 0.0)
        again = 0.0

        def moving() -> bool:
            nonlocal again
            now = time.monotonic()
            if now >= again:
                again = now + 0.1
                operator.graph.order('enable')
            at = operator.shafts[-1].position if operator.shafts else rest
            moved = max(abs(a - b) for a, b in zip(at, rest, strict=True)) > _MOVED_RAD
            return operator.graph.state == 'ENABLED' and moved

        return time.monotonic() - began if operator.serve(PROCESS_PATIENCE_S, moving) else None

    def close(self) -> None:
        self.operator.close()
        self.processes.close()
