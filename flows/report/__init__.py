"""The scene's report: ``document`` is the JSON, ``page`` the HTML made from it."""
