"""A scene through time: start, rows, frames, errors; it does not know the command line."""
