"""Name what a user's file did wrong."""


class UnreadableInput(ValueError):
    """A file or folder that cannot be read; the message names it and the remedy."""
