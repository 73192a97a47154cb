"""Real-time scheduling of a process: priority, processor cores, memory that is never swapped out.

The threads that carry messages, beats and devices get the fixed priority, and what works in the
background (the writer of a bag, the fit of a calibration) does not: sched(7), SCHED_FIFO and
SCHED_RESET_ON_FORK; mlockall(2).
"""

import ctypes
import os
import resource
from pathlib import Path

from endoscope_nodes.runtime.node_parameters import RealTimeParameters
from endoscope_nodes.runtime.parameters import ParameterError

_HOW = 'see ros_ws/doc/running.md'
_TASKS = Path('/proc/self/task')
# linux/capability.h and sys/mman.h.
_CAP_IPC_LOCK = 14
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
GRANTED_PRIORITY = 40


def threads_of_this_process() -> frozenset[int]:
    """Return the numbers by which the kernel knows its threads."""
    return frozenset(int(task.name) for task in _TASKS.iterdir())


def granted_priority() -> int:
    """Priority to take unasked: what the limits of this user grant, 0 for none."""
    # Only limits show that somebody meant it; root could have any priority.
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        return 0
    allowed = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    unlimited = allowed == resource.RLIM_INFINITY
    return GRANTED_PRIORITY if unlimited else min(GRANTED_PRIORITY, allowed)


def enter_real_time(
    node: str, wanted: RealTimeParameters, urgent: frozenset[int], simulated: bool
) -> None:
    """Apply the parameters; this thread, what it starts and `urgent` ones become urgent."""
    if wanted.cores:
        _keep_to(node, set(wanted.cores))
    priority = wanted.realtime_priority
    if not priority:
        return
    where = f"{node}: parameter 'realtime_priority' is {priority}"
    # Simulated time runs as fast as it can, and must not do so before all else.
    if simulated:
        raise ParameterError(
            f'{where}, which is not for simulated time; give 0, or to `graph` --real-time'
        )
    _lock_memory(where)
    try:
        for thread in (0, *urgent):
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError as error:
        allowed = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        raise ParameterError(
            f"{where}, for which this user needs a limit 'rtprio' of {priority} (it is {allowed}) "
            f'or CAP_SYS_NICE; {_HOW}'
        ) from error


def start_in_the_background() -> None:
    """Let threads that the calling one starts from now on have no fixed priority of their own."""
    policy = os.sched_getscheduler(0)
    os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_getparam(0))


def _keep_to(node: str, cores: set[int]) -> None:
    usable = os.sched_getaffinity(0)
    if not cores <= usable:
        raise ParameterError(
            f"{node}: parameter 'cores' is {sorted(cores)}; this process may use {sorted(usable)}"
        )
    for thread in threads_of_this_process():
        os.sched_setaffinity(thread, cores)


def _lock_memory(where: str) -> None:
    # Within a finite limit an allocation later, in motion, would fail.
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if limit != resource.RLIM_INFINITY and not _may_lock_all():
        raise ParameterError(
            f"{where}, for which this user needs an unlimited 'memlock' (it is {limit >> 10} KiB) "
            f'or CAP_IPC_LOCK; {_HOW}'
        )
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT):
        raise ParameterError(f'{where}: memory cannot be locked: {os.strerror(ctypes.get_errno())}')


def _may_lock_all() -> bool:
    lines = Path('/proc/self/status').read_text().splitlines()
    [effective] = [line.split()[1] for line in lines if line.startswith('CapEff')]
    return bool(int(effective, 16) >> _CAP_IPC_LOCK & 1)
