"""The subcommands of `endoscope`, one module each, in the order that `endoscope --help` lists them.

A module offers ``add_parser(subparsers)``, which adds one parser, and ``run(args) -> int``, which
gives the exit status. It imports nothing heavy at module level: every start of `endoscope` imports
all of them. Commands of other packages come after these, see `endoscope_bringup.subcommands`.
"""

COMMANDS: tuple[str, ...] = (
    'demo',
    'simulate',
    'explain',
    'investigate',
    'convert',
    'operate',
    'topics',
    'teleop',
    'record',
    'replay',
    'bag',
    'identify',
    'effects',
    'doctor',
    'completion',
)
