"""The commands of the command line: arguments in, exit code and text out."""
