"""One system through time, seen by probes; it knows no scene, no files and no errors of results."""
