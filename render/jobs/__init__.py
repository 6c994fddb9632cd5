"""Parts of every job of rendering: inputs, resumption and processes."""
