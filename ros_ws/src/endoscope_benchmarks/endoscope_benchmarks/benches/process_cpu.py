"""CPU time of another process."""

import os
from pathlib import Path


def cpu_seconds(pid: int) -> float:
    """User and system time in s that a running process has used so far (Linux ``/proc``)."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
