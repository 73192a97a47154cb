"""Progress of a long command: a bar in a terminal, else a line for each step."""

import shutil
import sys
import threading
import time
from typing import Self, TextIO

WIDTH = 20
REDRAWN_S = 1.0


class ProgressLine:
    """A bar of one line with the current step and the elapsed time, or a line for each step."""

    # `steps` is their approximate number, if :meth:`show` does not give the share: a bar is full
    # only when all is done. Where `stream` (default: stderr) is no terminal, each step is a line,
    # but not the `first`, which begins at once: bad input is refused in it, with one line alone.

    def __init__(self, steps: int = 1, first: str = '', stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._steps = steps
        self._done = 0.0
        self._step = first
        self._begun = time.monotonic()
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._shows = self._stream.isatty()
        self._clock = threading.Thread(target=self._redraw, daemon=True)

    def __enter__(self) -> Self:
        """Start the clock."""
        if self._shows:
            self._draw()
            self._clock.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        self._ended.set()
        if self._shows:
            self._clock.join()
            self._write('\r\x1b[K')

    def step(self, text: str) -> None:
        """Show the step that begins; findings of the audit are separate lines."""
        with self._lock:
            remark = text.startswith(('note:', 'audit:'))
            if not remark:
                self._done += 1
                self._step = text
            if remark or not self._shows:
                self._write(f'\r\x1b[K{text}\n' if self._shows else f'{text}\n')
            if self._shows:
                self._draw()

    def show(self, step: str, share: float) -> None:
        """Show the current step, and the share of the work that is done."""
        with self._lock:
            self._done = share * self._steps
            if self._shows:
                self._step = step
                self._draw()
            elif step != self._step:
                self._step = step
                self._write(f'{step}\n')

    def print(self, text: str, file: TextIO) -> None:
        """Print what was found above the bar."""
        with self._lock:
            if self._shows:
                self._write('\r\x1b[K')
            print(text, file=file, flush=True)

    def _redraw(self) -> None:
        while not self._ended.wait(REDRAWN_S):
            with self._lock:
                self._draw()

    def _draw(self) -> None:
        share = min(self._done / self._steps, 1.0 - 1.0 / WIDTH)
        full = round(WIDTH * share)
        elapsed = time.monotonic() - self._begun
        line = f'[{"#" * full}{"." * (WIDTH - full)}] {elapsed:.0f} s  {self._step}'
        self._write(f'\r\x1b[K{line[: shutil.get_terminal_size().columns - 1]}')

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()
