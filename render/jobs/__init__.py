"""Parts of every job of rendering: inputs, resumption, processes and clusters."""
