import sys
from pathlib import Path

from hypothesis import settings

# pytest imports each test file by its path; what they share is imported by name.
sys.path.insert(0, str(Path(__file__).parent))

# A busy machine takes its time, of which no deadline says anything.
settings.register_profile('endoscope', deadline=None)
settings.load_profile('endoscope')
