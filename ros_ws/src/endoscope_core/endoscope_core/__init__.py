"""Plant, effects, hysteresis models, controllers, classifier, identification; free of ROS."""
