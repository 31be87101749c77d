"""Latency reports: cold, cached and warm seconds per scene, object and step."""
