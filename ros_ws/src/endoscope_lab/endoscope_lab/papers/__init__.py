"""Tables and figures of the two papers, compared with ours."""
