"""The commands of the command line: they take arguments, print text and return an exit code."""
