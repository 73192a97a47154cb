"""No parameter within its bounds and no command of any motor brings the plant to infinity."""

from dataclasses import fields

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from endoscope_core.effects import CATALOGUE
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription, simulate

NOMINAL = JointParameters()


def value_of(parameter):
    if parameter.choices:
        return st.sampled_from(parameter.choices)
    if parameter.counted:
        return st.integers(int(parameter.low), int(parameter.high)).map(float)
    return st.one_of(
        st.sampled_from((parameter.low, parameter.high, parameter.typical)),
        st.floats(parameter.low, parameter.high),
    )


def effect_of(definition):
    return st.fixed_dictionaries({p.name: value_of(p) for p in definition.parameters}).map(
        lambda parameters: EffectSpec(definition.id, 'bend_x', parameters)
    )


effects = st.lists(
    st.sampled_from(tuple(CATALOGUE.values())),
    max_size=6,
    unique_by=lambda d: d.id,
).flatmap(lambda chosen: st.tuples(*map(effect_of, chosen)))
joints = st.builds(
    JointParameters,
    **{
        f.name: st.floats(0.3, 3.0).map(lambda factor, name=f.name: factor * getattr(NOMINAL, name))
        for f in fields(JointParameters)
    },
)
commands = st.lists(
    # Ten times what any node puts out.
    st.floats(-1.0, 1.0) | st.floats(-100.0, 100.0),
    min_size=1,
    max_size=12,
).map(lambda levels: np.repeat(np.array(levels)[:, None], 25, axis=0))


@settings(
    max_examples=400,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(joints, effects, commands, st.sampled_from([2, 3, 10]))
def test_stays_finite_and_bounded(joint, specs, command, substeps):
    plant = PlantDescription(joints={'bend_x': joint, 'bend_y': NOMINAL}, effects=specs)
    both = np.column_stack([command[:, 0], -command[:, 0]])
    run = simulate(plant, both, substeps=substeps)
    for name in ('shaft_position', 'shaft_velocity', 'shaft_effort', 'tension', 'bending'):
        assert np.isfinite(getattr(run, name)).all(), name
    assert (run.tension[:, 1] >= 0.0).all()
    # A massless joint goes no further than its wires and what else pulls on it.
    reach = 10.0 * np.abs(both / joint.gear).max() + 1e3
    assert np.abs(run.bending_true).max() < reach
