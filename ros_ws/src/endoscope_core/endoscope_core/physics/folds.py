"""From the effects' functions to one compiled function for each hook.

Numba inlines functions that are called by their names, and compiles them once for all; functions in
a tuple, or closures over them, cost up to twice the time and a compilation in every process. So the
calls are written out as source, by the catalogue and the table of places, into the folder that
holds the compiled cache. The functions of all places are the same few compiled ones.
"""

import importlib.util
import inspect
import sys
from collections.abc import Iterable, Sequence
from types import ModuleType

from endoscope_core.atomic_output import write_text
from endoscope_core.compiled import SOURCES, cache_folder
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.evaluation import MOST, ROWS, Row
from endoscope_core.physics.functions.places import Place
from endoscope_core.physics.hooks import HOOKS, LINKS, Fold, Function, Hook

_NAME = 'endoscope_folds'
_IMPORTS = """import math

from endoscope_core.compiled import compiled
from endoscope_core.physics.functions.evaluation import functions_act, sum_of_functions"""


def source() -> str:
    """Source of a module with one compiled function for each hook."""
    imports, functions = [_IMPORTS], []
    order = {effect_id: i for i, effect_id in enumerate((*CATALOGUE, *FUNCTIONS))}
    for hook in HOOKS:
        links = sorted(LINKS[hook.name], key=lambda link: order[link[0].id])
        names = []
        for effect, function in links:
            name = f'{effect.id}_{function.__name__}'
            imports.append(f'from {function.__module__} import {function.__name__} as {name}')
            names.append((effect, name))
        rows = [row for row in ROWS if row[1][0].hook is hook]
        if rows:
            functions.append(_functions(hook, rows))
        functions.append(_function(hook, names, rows))
    imports += sorted({line for row in ROWS for place in row[1] for line in _imports(place)})
    follow = [place for place in FUNCTIONS.values() if place.argument.follows]
    functions.append(_test('functions_follow', (), follow))
    return '\n'.join(imports) + '\n' + ''.join(functions)


def _function(hook: Hook, links: list[tuple[Effect, str]], rows: list[Row]) -> str:
    """Source of a hook's function, and of the test whether anything acts there."""
    results = [f'r{i}' for i in range(hook.results)]
    parts = ', '.join(f'd{i}' for i in range(hook.results))
    start = {Fold.FACTORS: '1.0', Fold.TERMS: '0.0', Fold.LEAST: 'math.inf'}.get(hook.fold)
    lines = [f'\n\n@compiled\ndef {hook.name}(on, {hook.arguments}):']
    if start is not None:
        lines += [f'    {name} = {start}' for name in results]

    def call(condition: str, function: str, through: str = '=') -> None:
        lines.append(f'    if {condition}:')
        if hook.fold is Fold.THROUGH:
            lines.append(f'        {hook.value} {through} {function}')
        elif hook.fold is Fold.LEAST:
            lines.append(f'        r0 = min(r0, {function})')
        elif hook.fold is Fold.CALLS:
            lines.append(f'        {function}')
        else:
            sign = '*' if hook.fold is Fold.FACTORS else '+'
            lines.append(f'        {parts} = {function}')
            lines.extend(f'        r{i} {sign}= d{i}' for i in range(hook.results))

    for effect, name in links:
        call(f'on[{effect.flag}]', f'{name}({hook.arguments})')
    if rows:
        # What functions give is added to a value that goes through the effects.
        call('functions_act(on)', f'{hook.name}_functions(on, {hook.arguments})', '+=')
    if hook.fold is not Fold.CALLS:
        given = hook.value if hook.fold is Fold.THROUGH else ', '.join(results)
        lines.append(f'    return {given}')
    elif not links:
        lines.append('    pass')
    effects = [effect for effect, _ in links]
    places = [place for _, row in rows for place in row]
    return '\n'.join(lines) + '\n' + _test(f'{hook.name}_acts', effects, places)


def _functions(hook: Hook, rows: list[Row]) -> str:
    """Source of a function that adds up those of a hook's places, and multiplies the sum."""
    lines = [f'\n\n@compiled\ndef {hook.name}_functions(on, {hook.arguments}):']
    lines.append('    r0, r1, m0, m1 = 0.0, 0.0, 1.0, 0.0')
    for number, places in rows:
        arguments = [_call(place.at) for place in places] + ['0.0'] * (MOST - len(places))
        given = f'on, p, {float(number)}, {float(len(places))}, {", ".join(arguments)}'
        only = '' if places[0].cell is None else f'cell == {places[0].cell} and '
        lines.append(f'    if {only}({_any_of(places)}):')
        lines.append(f'        value, slope, factor, steep = sum_of_functions({given})')
        sign, by_step = places[0].sign, places[0].by_step
        lines.append(f'        r0 += {_call(sign) if sign else "1.0"} * value')
        if by_step:
            lines.append(f'        r1 -= {_call(by_step)} * slope')
            lines.append(f'        m1 = m1 * factor + m0 * {_call(by_step)} * steep')
        lines.append('        m0 *= factor')
    given = 'math.exp(r0 * m0)' if hook.fold is Fold.FACTORS else 'r0 * m0'
    lines.append(f'    return {given}' + (', r1 * m0 - r0 * m1' if hook.results == 2 else ''))
    return '\n'.join(lines) + '\n'


def _imports(place: Place) -> list[str]:
    """Lines that import the functions of a place."""
    functions = [f for f in (place.at, place.sign, place.by_step) if f and not isinstance(f, str)]
    return [f'from {f.__module__} import {f.__name__}' for f in functions]


def _call(function: Function | str) -> str:
    """Source of a call with those of a hook's arguments that a function takes, by their names."""
    if isinstance(function, str):
        return function
    return f'{function.__name__}({", ".join(inspect.signature(function).parameters)})'


def _test(name: str, effects: Iterable[Effect], places: Sequence[Effect]) -> str:
    """Source of a function that tells whether any of some effects or places is on."""
    test = _any_of(effects)
    if places:
        test += f' or (functions_act(on) and ({_any_of(places)}))'
    return f'\n\n@compiled\ndef {name}(on):\n    return {test}\n'


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
    """Compiled function of a hook: flags first, then the hook's arguments.

    What effects give, and what the functions at the hook's places give beside it.
    """
    function: Function = getattr(_MODULE, hook.name)
    return function


def acting(hook: Hook) -> Function:
    """Compiled function of the flags that tells whether anything acts at a hook."""
    function: Function = getattr(_MODULE, f'{hook.name}_acts')
    return function


def follow() -> Function:
    """Compiled function of the flags: whether a state has to be advanced for functions alone."""
    function: Function = _MODULE.functions_follow
    return function
