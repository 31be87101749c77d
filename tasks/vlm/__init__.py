"""Ask a vision-language model over HTTP: Google's API, or any OpenAI-compatible server."""

from tasks.vlm.ask import asker
from tasks.vlm.unavailable import ModelUnavailable

__all__ = ["ModelUnavailable", "asker"]
