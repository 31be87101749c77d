"""Rotations, the Gravity-View frame, cameras, similarity alignment, planes and peaks."""
