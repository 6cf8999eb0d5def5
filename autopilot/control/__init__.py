"""The control cascade, one file for each law: state and memory in, memory and command out."""
