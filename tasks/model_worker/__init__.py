"""The far side of a model that runs in an environment of its own (docs/model_workers.md).

What is here, and what it imports, needs the standard library, numpy and jaxtyping only.
"""
