"""From the effects' functions to one compiled function for each hook.

Numba inlines functions that are called by their names, and compiles them once for all; functions in
a tuple, or closures over them, cost up to twice the time and a compilation in every process. So the
calls are written out as source, by the catalogue and the table of places, into the folder that
holds the compiled cache. The functions of all places are the same few compiled ones.
"""

import importlib.util
import sys
from collections.abc import Iterable
from types import ModuleType

from endoscope_core.atomic_output import write_text
from endoscope_core.compiled_cache import SOURCES, cache_folder
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import KEPT_UP
from endoscope_core.physics.functions.summation import MOST, ROWS
from endoscope_core.physics.hooks import HOOKS, LINKS, Fold, Function, Hook

_NAME = 'endoscope_folds'
_SUM = 'endoscope_core.physics.functions.summation import sum_of_functions'


def source() -> str:
    """Source of a module with one compiled function for each hook."""
    imports = ['import math', '', 'from endoscope_core.compiled import compiled']
    imports.append(f'from {_SUM}')
    functions = []
    order = {effect_id: i for i, effect_id in enumerate((*CATALOGUE, *FUNCTIONS))}
    for hook in HOOKS:
        links = sorted(LINKS[hook.name], key=lambda link: order[link[0].id])
        names = []
        for effect, function in links:
            name = f'{effect.id}_{function.__name__}'
            imports.append(f'from {function.__module__} import {function.__name__} as {name}')
            names.append((effect, name))
        functions.append(_function(hook, names))
        if any(places[0].hook is hook for _, places in ROWS):
            functions.append(_functions(hook))
    follow = [place for place in FUNCTIONS.values() if place.at in KEPT_UP or place.argument.lags]
    functions.append(_test('functions_follow', follow))
    return '\n'.join(imports) + '\n' + ''.join(functions)


def _function(hook: Hook, links: list[tuple[Effect, str]]) -> str:
    results = [f'r{i}' for i in range(hook.results)]
    given = ', '.join(results)
    parts = [f'd{i}' for i in range(hook.results)]
    start = {Fold.FACTORS: '1.0', Fold.TERMS: '0.0', Fold.LEAST: 'math.inf'}.get(hook.fold)
    lines = [f'\n\n@compiled\ndef {hook.name}(on, {hook.arguments}):']
    if start is not None:
        lines += [f'    {name} = {start}' for name in results]
    for effect, name in links:
        call = f'{name}({hook.arguments})'
        lines.append(f'    if on[{effect.flag}]:')
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
    return '\n'.join(lines) + '\n' + _test(f'{hook.name}_acts', [effect for effect, _ in links])


def _functions(hook: Hook) -> str:
    """Source of a function that adds up those of a hook's places, and multiplies the sum."""
    lines = [f'\n\n@compiled\ndef {hook.name}_functions(on, {hook.arguments}):']
    lines.append('    r0, r1, m0, m1 = 0.0, 0.0, 1.0, 0.0')
    rows = [(number, places) for number, places in ROWS if places[0].hook is hook]
    for number, places in rows:
        arguments = [place.at for place in places] + ['0.0'] * (MOST - len(places))
        given = f'on, p, {float(number)}, {float(len(places))}, {", ".join(arguments)}'
        only = f'{places[0].only} and ' if places[0].only else ''
        lines.append(f'    if {only}({_any_of(places)}):')
        lines.append(f'        value, slope, factor, steep = sum_of_functions({given})')
        lines.append(f'        r0 += {places[0].sign or "1.0"} * value')
        if places[0].by_step:
            lines.append(f'        r1 -= {places[0].by_step} * slope')
            lines.append(f'        m1 = m1 * factor + m0 * {places[0].by_step} * steep')
        lines.append('        m0 *= factor')
    given = 'math.exp(r0 * m0)' if hook.fold is Fold.FACTORS else 'r0 * m0'
    lines.append(f'    return {given}' + (', r1 * m0 - r0 * m1' if hook.results == 2 else ''))
    whole = [place for _, places in rows for place in places]
    return '\n'.join(lines) + '\n' + _test(f'{hook.name}_functions_act', whole)


def _test(name: str, terms: Iterable[Effect]) -> str:
    """Source of a function that tells whether any of some terms is on."""
    return f'\n\n@compiled\ndef {name}(on):\n    return {_any_of(terms)}\n'


def _any_of(terms: Iterable[Effect]) -> str:
    return ' or '.join(f'on[{term.flag}]' for term in terms) or 'False'


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


def sum_of(hook: Hook) -> Function:
    """Compiled function of what the functions at a hook's places give, with a fold's arguments.

    It belongs behind `functions_act`. Of factors it is one, to be multiplied; else it is to be
    added.
    """
    function: Function = getattr(_MODULE, f'{hook.name}_functions')
    return function


def some_of(hook: Hook) -> Function:
    """Compiled test of the flags: has any of a hook's places a function? Behind `functions_act`."""
    function: Function = getattr(_MODULE, f'{hook.name}_functions_act')
    return function


def follow() -> Function:
    """Compiled function of the flags: whether functions depend on the states `KEPT_UP`."""
    function: Function = _MODULE.functions_follow
    return function
