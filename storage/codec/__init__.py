"""Turn values (frozen dataclasses of arrays) into the members of an object and back.

``tree`` takes a value apart into a JSON tree and leaves (arrays, long texts, bytes,
tables); ``packing`` says how leaves share Zarr arrays; ``arrays`` and ``tables`` write and
read them; ``content`` hashes the logical value; ``values`` puts it together.
"""
