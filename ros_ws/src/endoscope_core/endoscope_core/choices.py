"""What an operator chooses by name: compensation, motions and devices.

The names alone, so that whoever only lists them loads nothing of what they do.
"""

HYSTERESIS_MODELS = ('bouc_wen', 'dahl')
PHYSICAL = 'physical'
"""Mode that inverts the plant which a calibration identified."""
ADAPTIVE_PHYSICAL = 'adaptive_physical'
"""The same mode with parameters that follow the tracker."""
MODES = ('none', *HYSTERESIS_MODELS, PHYSICAL, ADAPTIVE_PHYSICAL)
"""Modes of feed-forward compensation."""

BY_CLASS = 'class'
BY_SIZE = 'size'
BY_PLANT = 'plant'
BY_ADOPTED = 'adopted'
"""Selection by a plant file that has been adopted, whatever a calibration found."""
SELECTIONS = (BY_CLASS, BY_SIZE, BY_PLANT, BY_ADOPTED)
"""What selects the parameters of a mode."""

SINUSOID = 'sinusoid'
"""Name of the calibration sinusoid."""
BRIEF = 'brief'
"""Name of the brief calibration."""
CALIBRATION_MOTIONS = (SINUSOID, BRIEF)
"""Motions by which a tube is judged."""

PLAYED_MOTIONS = ('calibration', 'periodic', 'non_periodic', 'commissioning')
"""Motions that the master plays."""

FOLLOW_THE_HANDLE = 'master'
PLAYS = ('motion', 'file')
"""Sources of the master by which it moves the slave by itself."""
SOURCES = ('none', *PLAYS, FOLLOW_THE_HANDLE)
"""Where the master's commands come from."""

WAIVABLE = ('motor/measured_js', 'wires/measured_js')
"""Topics that an explanation can do without where the caller says so."""

SIMULATED = 'simulated'
MOTOR_DEVICES = (SIMULATED, 'dynamixel')
LOAD_CELL_DEVICES = (SIMULATED, 'modbus_rtu', 'modbus_tcp')
TRACKER_DEVICES = (SIMULATED, 'aurora')
LOG_LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')
LOG_LEVEL_VARIABLE = 'ENDOSCOPE_LOG_LEVEL'
"""In the environment: the least that nodes say to the log."""
