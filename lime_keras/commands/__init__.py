"""`lime-estimate` and `lime-export`."""
