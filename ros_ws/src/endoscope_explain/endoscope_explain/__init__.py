"""What a simulation leaves out, found from recordings; for notebooks and scripts.

import endoscope_explain

measured = endoscope_explain.read('recording')
found = endoscope_explain.explain('recording', 'plant.yaml')
again = endoscope_explain.simulate(found.plant, 'recording')
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from endoscope_explain.notebook import explain, read, simulate

__all__ = ['explain', 'read', 'simulate']


def __getattr__(name: str) -> Any:
    # What the three need takes seconds to import; other rooms of the package need none of it.
    if name in __all__:
        from endoscope_explain import notebook

        return getattr(notebook, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
