"""What a model costs to load and to run, bare and through GARDEN's steps, by number of photos."""
