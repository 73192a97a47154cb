import sys
from pathlib import Path

# pytest imports each test file by its path; what they share is imported by name.
sys.path.insert(0, str(Path(__file__).parent))
