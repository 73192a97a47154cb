"""The message ``compensator/state``: the model in force, in numbers and in words."""

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.control import FeedforwardLaw
from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_nodes.names import JOINTS
from endoscope_nodes.runtime.diagnostics import OK, diagnostic_array, status
from endoscope_nodes.runtime.node_parameters import CompensatorParameters


def compensator_state(
    stamp_ns: int,
    law: FeedforwardLaw,
    wanted: CompensatorParameters,
    gear: float,
    findings: CalibrationFindings | None,
    words: str,
) -> DiagnosticArray:
    """Say which law is in force, and which one is `wanted`."""
    values: dict[str, object] = {
        'mode': law.mode,
        'wanted_mode': wanted.mode,
        'selected_by': wanted.selected_by,
        'lead': wanted.lead,
        'gear': gear,
    }
    if findings is not None and findings.class_deg is not None:
        values['class_deg'] = findings.class_deg
    for joint, parameters in zip(JOINTS, law.parameters, strict=False):
        values |= {f'{joint}.{key}': value for key, value in parameters.to_dict().items()}
    return diagnostic_array(stamp_ns, status('compensator: model', OK, words, values))
