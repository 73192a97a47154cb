"""Plant, effects, hysteresis models, controllers, classifier, identification; free of ROS."""

from endoscope_core.compiled_cache import use_cache_of_these_sources

use_cache_of_these_sources()
