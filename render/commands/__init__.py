"""The commands of `lime-render`: the options of each, and what it does."""
