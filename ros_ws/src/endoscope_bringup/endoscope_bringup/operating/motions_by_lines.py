"""JSON-lines protocol on stdin/stdout by which another program plays the motions."""

import json
from pathlib import Path
from typing import TextIO

from endoscope_core.errors import EndoscopeError, NotPlayedError, RigStoppedError
from endoscope_explain.investigation.motions import RigMotion


class MotionsByLines:
    """Writes a request for each motion as a line, and reads its outcome from the line in reply."""

    def __init__(self, asked: TextIO, answers: TextIO) -> None:
        self._asked, self._answers = asked, answers

    def say(self, sentence: str) -> None:
        """Write a sentence of the log."""
        self._write({'say': sentence})

    def play(self, motion: RigMotion, file: Path, bag: Path, plant: Path | None = None) -> None:
        """Have a motion played and recorded; see `endoscope_nodes.client.motion_player`."""
        asked = {
            'words': motion.words,
            'why': motion.why,
            'duration': motion.duration,
            'file': str(file.absolute()),
            'bag': str(bag.absolute()),
            'plant': '' if plant is None else str(plant.absolute()),
        }
        self._write({'play': asked})
        line = self._answers.readline()
        if not line:
            raise NotPlayedError('the program that plays the motions has ended')
        answer = json.loads(line)
        became, why = answer['became'], answer['why']
        if became == 'not_played':
            raise NotPlayedError(why)
        if became == 'rig_stopped':
            raise RigStoppedError(why)
        if became != 'played':
            raise EndoscopeError(why)

    def _write(self, message: dict[str, object]) -> None:
        print(json.dumps(message), file=self._asked, flush=True)
