"""Measures the graph with each node in a process of its own."""

import os
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from endoscope_benchmarks.bench import cpu_seconds
from endoscope_benchmarks.process_faults.node_processes import NODES, NodeProcesses
from endoscope_benchmarks.process_faults.operator import Operator
from endoscope_core.safety import OperatingState
from endoscope_nodes.runtime.private_domain import private_domain

CARRIED = 0.99
_OBEYING = ('compensator', 'motor_driver')
_SETTLING_S = 2.0
_PATIENCE_S = 120.0


@dataclass(frozen=True)
class ProcessesFigure:
    """Each node a process of its own."""

    rate: int  # beats per second that were asked for
    ticks: float  # share of them that the motor driver made
    commands: float  # that it obeyed, as a share of those beats
    cores: float  # CPU time of all processes per second
    load: float  # load average of the machine at the end
    state: str  # operating state at the end
    # What became of the commands from node to node: how many the master sent, how many of them the
    # compensator and the motor driver obeyed, and why the others were refused. What is missing
    # beyond the refusals was replaced by newer ones before it was read.
    hops: str

    @property
    def carried(self) -> bool:
        """Whether this rate is kept up with."""
        return self.ticks >= CARRIED and self.commands >= CARRIED

    def __str__(self) -> str:
        return (
            f'{len(NODES)} processes at {self.rate} Hz: {100 * self.ticks:.1f} % of ticks, '
            f'{100 * self.commands:.1f} % of commands obeyed, {self.cores:.2f} cores, '
            f'load average {self.load:.1f}'
            + ('' if self.carried else f': not carried, {self.state}, {self.hops}')
        )


def run_processes_bench(rate: int, seconds: float) -> ProcessesFigure:
    """Measure the graph with a process for each node, at beats per second that divide 1000."""
    domain = private_domain()
    with (
        tempfile.TemporaryDirectory() as folder,
        NodeProcesses(domain, Path(folder)) as processes,
        Operator(domain) as operator,
    ):
        of_node: dict[str, dict[str, object]] = {
            'console': {'source': 'motion'},
            'recorder': {'bag': f'{folder}/bag'},
        }
        for node in NODES:
            processes.start(node, {node: of_node.get(node, {}) | {'tick_rate': rate}})
        _enable(operator)
        operator.serve(_SETTLING_S)
        before = _counts(operator)
        cpu = sum(map(cpu_seconds, processes.pids))
        began = time.monotonic()
        operator.serve(seconds)
        after, elapsed = _counts(operator), time.monotonic() - began
        state = operator.graph.state
        cpu = sum(map(cpu_seconds, processes.pids)) - cpu
    done = after - before
    due = done['ticks'] + done['missed ticks']
    return ProcessesFigure(
        rate=rate,
        ticks=done['ticks'] / due,
        commands=done['motor_driver accepted'] / due,
        cores=cpu / elapsed,
        load=os.getloadavg()[0],
        state=state,
        hops=_hops(done),
    )


def _hops(done: Counter[str]) -> str:
    text = f'the master sent {done["sent"]}'
    for node in _OBEYING:
        refused = [f'{n} {key}' for key, n in done.items() if key.startswith(f'{node} refused')]
        text += ', '.join([f', {node} obeyed {done[f"{node} accepted"]}', *refused])
    return text


def _enable(operator: Operator) -> None:
    """Wait until every node is heard and the slave follows commands."""
    deadline = time.monotonic() + _PATIENCE_S
    while operator.graph.state != OperatingState.ENABLED or len(operator.graph.heard_ns) < len(
        NODES
    ):
        if time.monotonic() > deadline:
            silent = sorted(set(NODES) - set(operator.graph.heard_ns))
            raise RuntimeError(f'{operator.graph.state or "no state"}; silent: {", ".join(silent)}')
        operator.graph.order('enable')
        operator.serve(1.0)


def _counts(operator: Operator) -> Counter[str]:
    """Ticks of the motor driver, and of each node what it sent, obeyed and refused."""
    operator.serve(1.1)
    device = operator.graph.health['motor_driver: device'].values
    found = Counter({key: int(device[key]) for key in ('ticks', 'missed ticks')})
    found['sent'] = int(operator.graph.health['console: commands'].values['published'])
    for node in _OBEYING:
        for key, value in operator.graph.health[f'{node}: commands'].values.items():
            if key.startswith(('accepted', 'refused')):
                found[f'{node} {key}'] = int(value)
    return found
