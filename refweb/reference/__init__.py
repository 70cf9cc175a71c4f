"""Reference of scene files: values by path, its tables in words and as a schema; it knows no scene."""
