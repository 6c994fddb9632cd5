"""Which variant of Mitsuba runs here, and the libLLVM that the fast one needs."""
