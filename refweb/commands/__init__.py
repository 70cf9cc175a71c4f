"""The verbs of the command line, one file each; they know everything, and nothing knows them."""
