"""Commands of the command line that work on a release, one module each."""
