"""`python -m autopilot`: the `autopilot` program."""

from autopilot.shell.program import main

if __name__ == "__main__":
    main()
