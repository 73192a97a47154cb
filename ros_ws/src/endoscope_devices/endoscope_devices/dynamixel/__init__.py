"""ROBOTIS XM430 servos on a Dynamixel Protocol 2.0 bus."""
