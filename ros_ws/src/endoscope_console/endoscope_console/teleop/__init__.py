"""The operator's hand at the page or at sticks: frames, lease, dead-man and handle."""
