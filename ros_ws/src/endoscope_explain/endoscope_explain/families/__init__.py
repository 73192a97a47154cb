"""Missing physics as a smooth function of one state at a place of the chain, where no name fits."""
