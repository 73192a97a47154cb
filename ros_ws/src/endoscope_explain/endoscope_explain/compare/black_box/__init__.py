"""Black boxes on the residual: what prediction alone can reach, without any physics."""
