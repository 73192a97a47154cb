"""The plant's answer to the commands of a bag."""
