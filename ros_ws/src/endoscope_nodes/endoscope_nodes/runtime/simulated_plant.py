"""The plant that the nodes of a simulated slave share."""

from endoscope_core.errors import FileError
from endoscope_core.physics import PlantDescription, load_plant
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import describe
from endoscope_nodes.names import JOINTS
from endoscope_nodes.runtime.parameters import ParameterError


def load_slave(source: str, path: str) -> PlantDescription:
    """Load a plant file of both joints that `source` names; an empty path is the nominal plant."""
    if not path:
        return PlantDescription()
    try:
        plant = load_plant(path)
    except (FileError, OSError) as error:
        raise ParameterError(f'{source}: {error}') from error
    if plant.joint_names() != JOINTS:
        raise ParameterError(
            f'{source}: {path} describes {", ".join(plant.joints)}; '
            f'the nodes need {", ".join(JOINTS)} in this order'
        )
    for spec in plant.effects:
        if describe(spec.id).stage is Stage.RECORDING:
            raise ParameterError(
                f'{source}: {path} has the effect {spec.id}, which acts '
                'on recordings: leave it out here, and let `endoscope simulate` apply it'
            )
    return plant
