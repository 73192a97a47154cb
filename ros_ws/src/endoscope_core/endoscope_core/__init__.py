"""Plant, effects, hysteresis models, controllers, classifier and identification of a tendon-sheath endoscope, free of ROS."""
