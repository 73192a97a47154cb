from hypothesis import settings

# The first example compiles the physics; no deadline fits that, and none says anything of it.
settings.register_profile('endoscope', deadline=None)
settings.load_profile('endoscope')
