"""The rig identified from recordings of its tubes, and a parameter set for each class."""
