"""Tell a user's mistake from a failure."""


class WrongUse(ValueError):
    """The command was given something it cannot work on; says what and what to do."""
