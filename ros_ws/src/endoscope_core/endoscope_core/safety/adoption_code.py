"""Why a compensator refuses a plant: a code for programs."""

from enum import StrEnum


class AdoptionCode(StrEnum):
    """Why a plant is not put into force, or the one before not again."""

    NONE = ''
    NOT_A_PLANT = 'not_a_plant'
    OTHER_JOINTS = 'other_joints'
    NOT_INVERTIBLE = 'not_invertible'
    BEYOND_RANGE = 'beyond_range'
    MOVING = 'moving'
    BUSY = 'busy'
    FAULT = 'fault'
    NOT_MEASURED = 'not_measured'
    NO_SESSION = 'no_session'
    OTHER_SESSION = 'other_session'
    OTHER_SENDER = 'other_sender'
    NOTHING_TO_UNDO = 'nothing_to_undo'
    WITHDRAWN = 'withdrawn'
