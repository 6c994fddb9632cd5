"""The choice of a Mitsuba variant that runs here, and the libLLVM that the fast variant needs."""
