"""How well each plant and each black box does on data that no fit has seen."""
