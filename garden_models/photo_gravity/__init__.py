"""Gravity from single photos, as models read it."""
