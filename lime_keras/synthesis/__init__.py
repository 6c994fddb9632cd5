"""Scenes that are made where the training runs: banks of geometry and of lights, and their use."""
