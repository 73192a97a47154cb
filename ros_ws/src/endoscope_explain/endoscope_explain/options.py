"""Options of `explain`, from which its command, its call in a notebook and references follow."""

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from endoscope_core.choices import WAIVABLE

if TYPE_CHECKING:
    from endoscope_core.rig import Rig

BAND = 0.15
"""Relative tolerance by which a healthy rig differs from its description."""
MOST_EFFECTS = 2
_COUNT = (1, 1_000_000)


def option(default: Any, what: str, metavar: str | None = None, **how: Any) -> Any:
    """A field that is an option, as argparse takes it; a number's `ends` are allowed."""
    return field(default=default, metadata={'help': what, 'metavar': metavar, **how})


@dataclass(frozen=True, kw_only=True)
class Options:
    """How recordings are explained."""

    rig: 'Rig | None' = option(
        None, 'rig file, if the bag contains none (default: the shipped rig)', 'rig.yaml', type=Path
    )
    baseline: Path | None = option(
        None, 'healthy recording of the same rig: only what is new is explained', 'BAG0', type=Path
    )
    validate: Path | None = option(
        None,
        'second recording of the same rig for validation; give it once for all bags or once for '
        'each',
        'BAG2',
        type=Path,
        action='append',
    )
    without: Collection[str] = option(
        (), 'a topic that may be missing', 'TOPIC', action='append', choices=WAIVABLE
    )
    namespace: str | None = option(
        None, "namespace of the rig's topics, if a bag has several rigs", 'NS'
    )
    band: float = option(
        BAND,
        "prior tolerance of the plant's parameters, as a share: 3 for a rig that was never "
        f'identified (default {BAND:g})',
        'SHARE',
        ends=(1e-6, 100.0),
    )
    effects: int = option(
        MOST_EFFECTS,
        'largest number of effects of a joint: 4 for a rig that the plant never matched '
        f'(default {MOST_EFFECTS})',
        'N',
        ends=_COUNT,
    )
    same_physics: bool = option(
        False,
        'all bags are of one rig, in other shapes or at other times: choose effects for all of '
        'them together',
    )
    jobs: int = option(2, 'parallel tasks (default 2)', 'N', ends=_COUNT)
    quick: bool = option(False, 'do not design a next experiment')
