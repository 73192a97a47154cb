import sys
from pathlib import Path

from hypothesis import settings

# pytest imports each test file by its path; what they share is imported by name.
sys.path.insert(0, str(Path(__file__).parent))

# The first example compiles the physics; no deadline fits that, and none says anything of it.
settings.register_profile('endoscope', deadline=None)
settings.load_profile('endoscope')
