"""Measure what orchestration costs: a step beside its peers, and a thousand scenes."""
