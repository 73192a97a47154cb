"""What a node watches to know whether it may move the slave: session, senders, clutch, streams."""
