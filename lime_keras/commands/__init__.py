"""The commands `lime-estimate` and `lime-export`."""
