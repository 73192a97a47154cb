"""mujoco.sysid: the nearest rig that MuJoCo can express, its numbers identified by MuJoCo's tool.

A wire is two springs with a carriage between them that rubs in the sheath: friction that grows
with tension all along a wire is none of MuJoCo's forces.
"""

from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import layout
from endoscope_explain.fit.free_parameters import BAND
from endoscope_lab.peers.problem import SIGNALS, OwnExample, Problem, Reply, on_grid

Array = NDArray[np.float64]

CARRIAGE_KG, JOINT_KG_M2 = 0.1, 1e-6
"""What has no mass here: light enough to answer ten times as fast as the servo; the lighter, the
faster MuJoCo's dry friction creeps under a load that it should hold."""
DAMPING_RATIO = 0.1
"""Of a carriage between two halves of a wire: its drag stays below a tenth of a newton."""
SHAFT_KG_M2 = 1.0
"""So much that the wires do not hold the servo back, as they do not in the plant."""
ITERATIONS = 10
"""Of Gauss and Newton; the second step leaves a per cent more than the last."""
READ = (
    layout.OUT_MOTOR, layout.OUT_TENSION_A, layout.OUT_TENSION_B, layout.OUT_BENDING,
)  # fmt: skip
"""What its sensors read, in their order."""
SIGNS = np.array([1.0, -1.0, -1.0, 1.0])
"""Sensors of wires give the force on the shaft, -T."""
DRY = 'solreffriction="0.002 1" solimpfriction="0.9999 0.9999"'
"""As stiff as MuJoCo has it at ticks of 1 ms, against creep."""
RIG = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="shaft"/>
      <inertial pos="0 0 0" mass="1" diaginertia="{shaft} {shaft} {shaft}"/>
    </body>
    <body>
      <joint name="bending" {dry}/>
      <inertial pos="0 0 0" mass="1" diaginertia="{joint} {joint} {joint}"/>
    </body>
    <body>
      <joint name="pos" type="slide" {dry}/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
    </body>
    <body>
      <joint name="neg" type="slide" {dry}/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="pos0"><joint joint="shaft" coef="{pulley}"/><joint joint="pos" coef="-1"/></fixed>
    <fixed name="pos1"><joint joint="pos" coef="1"/><joint joint="bending" coef="-{arm}"/></fixed>
    <fixed name="neg0"><joint joint="shaft" coef="-{pulley}"/><joint joint="neg" coef="-1"/></fixed>
    <fixed name="neg1"><joint joint="neg" coef="1"/><joint joint="bending" coef="{arm}"/></fixed>
  </tendon>
  <actuator>
    <general name="servo" joint="shaft" biastype="affine"/>
    <general name="pos0" tendon="pos0" biastype="affine" gainprm="0" forcerange="-1000 0"/>
    <general name="pos1" tendon="pos1" biastype="affine" gainprm="0" forcerange="-1000 0"/>
    <general name="neg0" tendon="neg0" biastype="affine" gainprm="0" forcerange="-1000 0"/>
    <general name="neg1" tendon="neg1" biastype="affine" gainprm="0" forcerange="-1000 0"/>
  </actuator>
  <sensor>
    <jointpos name="shaft" joint="shaft"/>
    <actuatorfrc name="pos0" actuator="pos0"/>
    <actuatorfrc name="neg0" actuator="neg0"/>
    <jointpos name="bending" joint="bending"/>
  </sensor>
</mujoco>
"""


def by_mujoco(problem: Problem) -> Reply:
    """What its report says, and the misfit that it leaves; it names nothing."""
    from mujoco import sysid
    from mujoco.sysid.report.sections.insights import AutomatedInsights

    observation = problem.refitted.model.observation
    nominal = problem.described.model.base
    spec, model = _rig(nominal)
    tick = observation.tick
    command = observation.inputs[0, :, layout.IN_COMMAND]
    control = np.zeros((len(command), model.nu))
    control[:, 0] = command
    columns = [SIGNALS.index(output) for output in READ]
    values = np.concatenate([channel.value for channel in observation.channels])
    noise = np.concatenate([channel.noise for channel in observation.channels])
    measured = on_grid(observation, values, problem.time)[:, columns] * SIGNS
    sequence = sysid.ModelSequences(
        'rig', spec, 'recording', sysid.create_initial_state(model, np.zeros(model.nq)),
        sysid.TimeSeries.from_control_names(tick * np.arange(len(command)), control, model),
        sysid.TimeSeries.from_names(problem.time, measured, model),
    )  # fmt: skip
    found, predicted = _identified(sequence, _parameters(nominal))
    seen = np.stack([np.interp(problem.time, predicted.times, y) for y in predicted.data.T], axis=1)
    unit = on_grid(observation, noise, problem.time)[:, columns]
    misfit = float(np.max(np.sqrt(np.mean(((measured - seen) / unit) ** 2, axis=0))))
    insights = AutomatedInsights('', found).get_context()['insights']
    said = ', '.join(sorted({insight['title'] for insight in insights}))
    plant = float(np.max(np.sqrt(np.mean(problem.residuals[:, columns] ** 2, axis=0))))
    return Reply(None, report=f'{said}; leaves {misfit:.3g} x noise, the plant {plant:.3g}')


def _rig(nominal: Array) -> tuple[Any, Any]:
    """Specification and model of a joint whose packed numbers are given."""
    import mujoco

    spec = mujoco.MjSpec.from_string(
        RIG.format(
            shaft=SHAFT_KG_M2, joint=JOINT_KG_M2, mass=CARRIAGE_KG, dry=DRY,
            pulley=nominal[layout.PULLEY_RADIUS], arm=nominal[layout.JOINT_RADIUS],
        )
    )  # fmt: skip
    parameters = _parameters(nominal)
    for parameter in parameters.values():
        parameter.apply_modifier(spec)
    return spec, spec.compile()


def _parameters(nominal: Array) -> Any:
    """What is identified: numbers within the band of the plant's own, and the sheath's friction."""
    from mujoco import sysid

    stiffness, tension = nominal[layout.WIRE_STIFFNESS], nominal[layout.PRETENSION]
    drag = 2.0 * DAMPING_RATIO * np.sqrt(4.0 * stiffness * CARRIAGE_KG)

    def servo(spec: Any, parameter: Any) -> None:
        bandwidth, ratio = parameter.value
        gain = SHAFT_KG_M2 * bandwidth**2
        spec.actuator('servo').gainprm[0] = gain
        spec.actuator('servo').biasprm[1:3] = -gain, -2.0 * SHAFT_KG_M2 * ratio * bandwidth

    def wires(spec: Any, parameter: Any) -> None:
        tension, stiffness = parameter.value
        for half in ('pos0', 'pos1', 'neg0', 'neg1'):
            spec.actuator(half).biasprm[:2] = -tension, -2.0 * stiffness

    def joint(spec: Any, parameter: Any) -> None:
        stiffness, damping, friction = parameter.value
        spec.joint('bending').stiffness[0] = stiffness
        spec.joint('bending').damping[0] = damping
        spec.joint('bending').frictionloss = friction

    def sheath(spec: Any, parameter: Any) -> None:
        for wire in ('pos', 'neg'):
            spec.joint(wire).frictionloss = parameter.value[0]
            spec.joint(wire).damping[0] = drag

    found = sysid.ParameterDict()
    reach = 1.0 + 4.0 / 3.0 * BAND
    for name, indices, modifier in (
        ('servo', (layout.MOTOR_BANDWIDTH, layout.MOTOR_DAMPING_RATIO), servo),
        ('wires', (layout.PRETENSION, layout.WIRE_STIFFNESS), wires),
        ('joint', (layout.JOINT_STIFFNESS, layout.JOINT_DAMPING, layout.JOINT_FRICTION), joint),
    ):
        value = nominal[list(indices)]
        found.add(sysid.Parameter(name, value, value / reach, value * reach, modifier=modifier))
    # What the sheath takes of a wire that is pulled through it with the pretension, and as much as
    # it can take when the wires carry several times that.
    lost = tension * (1.0 - np.exp(-nominal[layout.CAPSTAN_EXPONENT]))
    found.add(sysid.Parameter('sheath', lost, 0.0, 4.0 * lost, modifier=sheath))
    return found


def _identified(sequence: Any, parameters: Any) -> tuple[Any, Any]:
    """Parameters as identified, and the signals that they predict."""
    from mujoco import sysid

    residual = sysid.build_residual_fn(models_sequences=[sequence], n_threads=1)
    # It prints every step whatever `verbose` says.
    with redirect_stdout(StringIO()):
        found, _ = sysid.optimize(parameters, residual, verbose=False, max_iters=ITERATIONS)
    _, predicted, _ = residual(found.as_vector(), found, return_pred_all=True)
    return found, predicted[0][0]


def mujoco_example() -> OwnExample:
    """Of its own tests: a mass on a spring, pushed; its stiffness and damping from wrong ones."""
    import mujoco
    from mujoco import sysid

    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        '<joint name="slide" type="slide" stiffness="100" damping="5"/></body></worldbody>'
        '<actuator><motor name="push" joint="slide"/></actuator>'
        '<sensor><jointpos name="at" joint="slide"/></sensor></mujoco>'
    )
    model = spec.compile()
    data, time = mujoco.MjData(model), model.opt.timestep * np.arange(1500)
    start = sysid.create_initial_state(model, np.zeros(1))
    push = 10.0 * np.sin(2.0 * time + time**2)
    seen = []
    for force in push:
        data.ctrl[0] = force
        mujoco.mj_step(model, data)
        seen.append(float(data.sensordata[0]))
    stamps = model.opt.timestep * np.arange(1, 1501)

    def of_joint(name: str) -> Callable[[Any, Any], None]:
        def modify(spec: Any, parameter: Any) -> None:
            getattr(spec.joint('slide'), name)[0] = parameter.value[0]

        return modify

    sequence = sysid.ModelSequences(
        'spring', spec, 'push', start,
        sysid.TimeSeries.from_control_names(time, push[:, None], model),
        sysid.TimeSeries.from_names(stamps, np.array(seen)[:, None], model),
    )  # fmt: skip
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter('stiffness', 60.0, 10.0, 300.0, modifier=of_joint('stiffness')))
    parameters.add(sysid.Parameter('damping', 10.0, 0.5, 30.0, modifier=of_joint('damping')))
    found, _ = _identified(sequence, parameters)
    error = float(np.max(np.abs(found.as_vector() / [100.0, 5.0] - 1.0)))
    return OwnExample('mass on a spring', 'both numbers to 1 %', f'{error:.2%}', error < 0.01)
