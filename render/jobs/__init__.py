"""What the jobs of rendering have in common: inputs, resumption, processes and clusters."""
