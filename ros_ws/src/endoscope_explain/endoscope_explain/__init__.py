"""What a simulation leaves out, found from recordings; for notebooks and scripts.

import endoscope_explain

measured = endoscope_explain.read('recording')
found = endoscope_explain.explain(measured, 'plant.yaml')
again = endoscope_explain.simulate(found.plant, measured)

`from_arrays` takes measurements that are in no bag. Whatever cannot be used raises an
`EndoscopeError`, whose message is one line.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from endoscope_core.errors import EndoscopeError
    from endoscope_explain.notebook import explain, from_arrays, read, simulate

__all__ = ['EndoscopeError', 'explain', 'from_arrays', 'read', 'simulate']


def __getattr__(name: str) -> Any:
    # What these need takes seconds to import; other rooms of the package need none of it.
    if name in __all__:
        from endoscope_explain import notebook

        return getattr(notebook, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    # `help` and completion ask this, and would show __getattr__ for want of what it fetches.
    return __all__
