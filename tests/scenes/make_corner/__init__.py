"""Make the sample capture ``tests/scenes/corner``: everything in it is generated here.

Run it as ``python tests/scenes/make_corner --help``; it needs numpy and mitsuba only
(the optional extra ``sample``).
"""
