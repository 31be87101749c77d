"""Run the same chain of steps with ours and with others' caches.

A peer is a context manager over a chain and an empty folder. It gives a function that runs
the whole chain once: the first time every step misses, from then on every step hits.
"""
