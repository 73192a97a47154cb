"""From the effects' functions to one compiled function for each hook.

Numba inlines functions that are called by their names, and compiles them once for all; functions in
a tuple, or closures over them, cost up to twice the time and a compilation in every process. So the
calls are written out as source, by the catalogue, into the folder that holds the compiled cache.
"""

import importlib.util
import sys
from types import ModuleType

from endoscope_core.atomic_output import write_text
from endoscope_core.compiled_cache import SOURCES, cache_folder
from endoscope_core.physics import effects
from endoscope_core.physics.hooks import HOOKS, LINKS, Fold, Function, Hook

_NAME = 'endoscope_folds'


def source() -> str:
    """Source of a module with one compiled function for each hook."""
    imports = ['import math', '', 'from endoscope_core.compiled import compiled']
    functions = []
    order = {effect_id: i for i, effect_id in enumerate(effects.CATALOGUE)}
    for hook in HOOKS:
        links = sorted(LINKS[hook.name], key=lambda link: order[link[0].id])
        names = []
        for effect, function in links:
            name = f'{effect.id}_{function.__name__}'
            imports.append(f'from {function.__module__} import {function.__name__} as {name}')
            names.append((effect.flag, name))
        functions.append(_function(hook, names))
    return '\n'.join(imports) + '\n' + ''.join(functions)


def _function(hook: Hook, links: list[tuple[int, str]]) -> str:
    results = [f'r{i}' for i in range(hook.results)]
    given = ', '.join(results)
    parts = [f'd{i}' for i in range(hook.results)]
    start = {Fold.FACTORS: '1.0', Fold.TERMS: '0.0', Fold.LEAST: 'math.inf'}.get(hook.fold)
    lines = [f'\n\n@compiled\ndef {hook.name}(on, {hook.arguments}):']
    if start is not None:
        lines += [f'    {name} = {start}' for name in results]
    for flag, name in links:
        call = f'{name}({hook.arguments})'
        lines.append(f'    if on[{flag}]:')
        if hook.fold is Fold.THROUGH:
            lines.append(f'        {hook.value} = {call}')
        elif hook.fold is Fold.LEAST:
            lines.append(f'        r0 = min(r0, {call})')
        elif hook.fold is Fold.CALLS:
            lines.append(f'        {call}')
        else:
            sign = '*' if hook.fold is Fold.FACTORS else '+'
            lines.append(f'        {", ".join(parts)} = {call}')
            lines += [f'        {r} {sign}= {d}' for r, d in zip(results, parts, strict=True)]
    if hook.fold is Fold.THROUGH:
        given = hook.value
    if hook.fold is not Fold.CALLS:
        lines.append(f'    return {given}')
    elif not links:
        lines.append('    pass')
    tests = ' or '.join(f'on[{flag}]' for flag, _ in links) or 'False'
    lines.append(f'\n\n@compiled\ndef {hook.name}_acts(on):\n    return {tests}')
    return '\n'.join(lines) + '\n'


def _module() -> ModuleType:
    path = cache_folder(SOURCES) / f'{_NAME}.py'
    text = source()
    if not path.exists() or path.read_text(encoding='utf-8') != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text)
    spec = importlib.util.spec_from_file_location(_NAME, path)
    if spec is None or spec.loader is None:
        raise ImportError(f'{path} cannot be imported')
    module = importlib.util.module_from_spec(spec)
    sys.modules[_NAME] = module
    spec.loader.exec_module(module)
    return module


_MODULE = _module()


def folded(hook: Hook) -> Function:
    """Compiled function of a hook: flags first, then the hook's arguments."""
    function: Function = getattr(_MODULE, hook.name)
    return function


def acting(hook: Hook) -> Function:
    """Compiled function of the flags that tells whether any link of a hook is on."""
    function: Function = getattr(_MODULE, f'{hook.name}_acts')
    return function
